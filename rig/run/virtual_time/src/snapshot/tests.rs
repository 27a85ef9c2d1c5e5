//! A rig that restores a file goes on as the rig that wrote it. Every other file is refused.

use std::fs;

use masseter_runtime::messages::codes::DriveRequest;
use masseter_runtime::messages::{Command, LAYOUT_VERSION};
use proptest::prelude::*;
use tempfile::tempdir;

use super::*;
use crate::Rig;
use crate::run::tests::with_keys;

/// A file has no more bytes.
const MOST_WRITTEN: usize = 256 * 1024;

/// A rig after so many steps in which the drives are asked to stay where they are.
fn stepped(scenario: &Scenario, steps: usize) -> Rig {
    let mut rig = Rig::new(scenario, scenario.seed).unwrap();
    step(&mut rig, steps);
    rig
}

fn step(rig: &mut Rig, steps: usize) {
    for _ in 0..steps {
        let (target_m, request) = (rig.reading().position_m, DriveRequest::Enable.code());
        let (version, reading_cycle) = (LAYOUT_VERSION, rig.reading().cycle);
        rig.step(&Command { reading_cycle, target_m, request, version, ..Command::default() }).unwrap();
    }
}

fn problem(rig: &Rig, bytes: &[u8]) -> SnapshotProblem {
    rig.snapshot().decoded(bytes).unwrap_err()
}

#[test]
fn a_file_is_written_whole_and_replaces_another_one() {
    let (folder, rig) = (tempdir().unwrap(), stepped(&Scenario::default(), 900));
    let path = folder.path().join("a.snapshot");
    for _ in 0..2 {
        rig.snapshot().write_to(&path).unwrap();
    }
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "nothing unfinished stays");
    assert_eq!(fs::read(&path).unwrap(), rig.snapshot().encode());
    assert_eq!(rig.read_snapshot(&path).unwrap().encode(), rig.snapshot().encode());
    let nowhere = folder.path().join("missing/a.snapshot");
    for refusal in [rig.snapshot().write_to(&nowhere).unwrap_err(), rig.read_snapshot(&nowhere).unwrap_err()]
    {
        assert!(matches!(refusal.problem, SnapshotProblem::File(_)), "{refusal}");
        assert!(refusal.to_string().contains("missing/a.snapshot"), "{refusal}");
    }
}

#[test]
fn a_file_with_a_delayed_encoder_is_small() {
    let everything = with_keys(
        "[teeth]\n[food]\n[load_cell]\n[dynamics.friction]\nmodel = 'lugre'\n[[stimulus]]\nat_s = 1.0\n\
         food = { stiffness_n_per_m = 5000.0 }\n\
         [[faults]]\nkind = 'encoder_delay'\naxis = 'l1'\nsize = '100 ms'\nfrom_s = 0.1\n\
         [[faults]]\nkind = 'babble'\nbus = 1\nnode = 4\nfrom_s = 0.85\n",
    );
    let bytes = stepped(&everything, 900).snapshot().encode().len();
    assert!(bytes <= MOST_WRITTEN, "{bytes} bytes");
}

#[test]
fn a_file_that_is_cut_or_changed_anywhere_is_refused() {
    let bytes = stepped(&Scenario::default(), 300).snapshot().encode();
    assert!(content(&bytes).is_ok());
    for length in 0..bytes.len() {
        assert!(content(&bytes[..length]).is_err(), "{length} bytes");
    }
    let mut changed = bytes.clone();
    for place in 0..bytes.len() {
        changed[place] ^= 1 << (place % 8);
        assert!(content(&changed).is_err(), "byte {place}");
        changed[place] = bytes[place];
    }
    changed.push(0);
    assert!(matches!(content(&changed), Err(SnapshotProblem::Damaged)));
}

#[test]
fn a_file_of_another_format_build_scenario_or_seed_is_refused_and_says_what_to_do() {
    let rig = stepped(&with_keys("name = 'one'\nseed = 1"), 10);
    let bytes = rig.snapshot().encode();
    let content = content(&bytes).unwrap();
    assert!(matches!(problem(&rig, b"MCAP"), SnapshotProblem::NoSnapshot));
    assert!(matches!(problem(&rig, &framed(FORMAT + 1, content)), SnapshotProblem::Version(2)));
    let mut of_other_build = content.to_owned();
    let place = content.windows(SOURCES.len()).position(|text| text == SOURCES.as_bytes()).unwrap();
    of_other_build[place] = b'x';
    assert!(matches!(problem(&rig, &framed(FORMAT, &of_other_build)), SnapshotProblem::OtherBuild));
    for (keys, seed, reason) in [
        ("name = 'two'\nseed = 1", 1, "is of scenario 'one', seed 1, the rig of scenario 'two', seed 1"),
        ("name = 'one'\nseed = 1", 2, "is of scenario 'one', seed 1, the rig of scenario 'one', seed 2"),
        ("name = 'one'\nrate_hz = 500", 1, "with other values of its keys"),
    ] {
        let refusal = problem(&Rig::new(&with_keys(keys), seed).unwrap(), &bytes).to_string();
        assert!(refusal.contains(reason) && refusal.contains("make a rig"), "{refusal}");
    }
}

#[test]
fn a_file_is_refused_where_a_table_of_the_scenario_has_changed() {
    let folder = tempdir().unwrap();
    let table = folder.path().join("push.csv");
    let write = |force_n| {
        let rows: Vec<_> = (1..10_000).map(|row| format!("{row}e-4,0,0,{force_n}")).collect();
        fs::write(&table, format!("time_s,force_x_n,force_y_n,force_z_n\n0,0,0,0\n{}", rows.join("\n")))
            .unwrap();
    };
    write(-1.0);
    let scenario = with_keys(&format!("[[stimulus]]\nat_s = 0.0\npush_table = '{}'", table.display()));
    let mut rig = stepped(&scenario, 10);
    let bytes = rig.snapshot().encode();
    assert!(bytes.len() <= MOST_WRITTEN, "{} bytes", bytes.len());
    let mut branch = Rig::new(&scenario, scenario.seed).unwrap();
    branch.restore(&branch.snapshot().decoded(&bytes).unwrap()).unwrap();
    step(&mut rig, 10);
    step(&mut branch, 10);
    assert!(branch.snapshot().encode() == rig.snapshot().encode(), "the rows of the table act in both");
    write(-2.0);
    assert!(matches!(problem(&Rig::new(&scenario, 1).unwrap(), &bytes), SnapshotProblem::OtherTable));
    write(-1.0);
    Rig::new(&scenario, 1).unwrap().snapshot().decoded(&bytes).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// A state with the right checksum that no rig has written.
    #[test]
    fn a_forged_state_is_read_or_refused(
        steps in 0_usize..40, places in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5),
    ) {
        let rig = stepped(&Scenario::default(), steps);
        let bytes = rig.snapshot().encode();
        let mut forged = content(&bytes).unwrap().to_owned();
        let of_state = own_bytes(&rig)..forged.len();
        for (place, byte) in places {
            forged[of_state.start + place.index(of_state.len())] = byte;
        }
        match rig.snapshot().decoded(&framed(FORMAT, &forged)) {
            Ok(read) => {
                let again = rig.snapshot().decoded(&read.encode()).unwrap();
                prop_assert!(again.encode() == read.encode(), "what was read is what is written");
            }
            Err(SnapshotProblem::Damaged | SnapshotProblem::OtherTable) => {}
            Err(other) => prop_assert!(false, "{other}"),
        }
    }
}

/// The bytes before the state.
fn own_bytes(rig: &Rig) -> usize {
    postcard::to_allocvec(&Belonging::to(&rig.snapshot().scenario)).unwrap().len()
}
