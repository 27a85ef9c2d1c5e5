//! Values that a motion changes for its own duration, and the debts of a killed motion.

use std::io;
use std::sync::{Arc, Mutex};

use super::*;
use crate::loan::{Borrowed, Loan};

/// A ledger that a test can read.
#[derive(Debug, Clone, Default)]
struct Notes(Arc<Mutex<Vec<OldValue>>>);

impl Ledger for Notes {
    fn keep(&mut self, axis: usize, values: &[OldValue]) -> io::Result<()> {
        assert_eq!(axis, L1);
        *self.0.lock().unwrap() = values.to_vec();
        Ok(())
    }
}

/// A step killed at any moment: the kept values until then return all old values.
#[test]
fn kept_values_return_what_a_killed_step_has_changed() {
    let mut bench = Bench::new("");
    let (notes, before) = (Notes::default(), bench.objects());
    bench.line.keep_old_values_in(Box::new(notes.clone()));
    let kept = notes.clone();
    let order = JogOrder::usual(&bench.scenario, L1, 1e-3);
    let mut at_kill = Vec::new();
    jog(&mut bench.line, &bench.scenario, &order, &mut |_| {
        at_kill.clone_from(&kept.0.lock().unwrap());
        Wish::Move
    })
    .unwrap();
    assert!(at_kill.len() > 6, "{at_kill:?}");
    assert_eq!(
        (bench.objects(), notes.0.lock().unwrap().len()),
        (before.clone(), 0),
        "nothing is owed any more"
    );
    // The drive as the kill left it.
    for old in &at_kill {
        let reduced = if old.object.0.index == 0x607D { old.value } else { 1 };
        bench.line.write(L1, old.object.0, reduced, old.bytes).unwrap();
    }
    assert_ne!(bench.objects(), before);
    assert_eq!(give_back(&mut bench.line, L1, &at_kill).unwrap(), []);
    assert_eq!(bench.objects(), before);
}

/// A cable pulled between reading and writing: the drive may have the value, so the ledger keeps the old value.
#[test]
fn a_write_without_an_answer_is_not_forgotten_and_a_refused_one_is() {
    let play = |text: &str, loan| {
        let mut bench = Bench::new(text);
        let notes = Notes::default();
        bench.line.keep_old_values_in(Box::new(notes.clone()));
        let mut borrowed = Borrowed::of_axis(L1, bench.scenario.profile(L1));
        let error = borrowed.set_all(&mut bench.line, &[loan]).err();
        (error.map(|error| error.abort_code()), notes.0.lock().unwrap().len())
    };
    let (refused, owed) = play("", Loan::new(0x6098, 0, 99, 1));
    assert!(refused.flatten().is_some() && owed == 0, "nothing is changed");
    let pulled = |ms| {
        let cable =
            format!("[[faults]]\nkind = 'disconnect'\nbus = 1\nnode = 4\nfrom_s = {}", f64::from(ms) / 1e3);
        play(&cable, Loan::new(0x6081, 0, 77, 4))
    };
    let silent = [Some(None)];
    let lost: Vec<_> = (100..106).map(pulled).filter(|(error, _)| silent.contains(error)).collect();
    assert!(lost.contains(&(Some(None), 0)) && lost.contains(&(Some(None), 1)), "{lost:?}");
}

/// A drive keeps the last force of its process data, which some drives add in every mode.
#[test]
fn a_jog_clears_the_offsets_for_good() {
    let mut bench = Bench::new("");
    let offset = ObjectAddress::new(0x60B2, 0);
    bench.line.write(L1, offset, 55, 2).unwrap();
    bench.jog(1e-3).unwrap();
    assert_eq!(bench.line.read_number(L1, offset).unwrap(), 0);
}

/// Drives watch the heartbeat of 150 ms, and each keeping waits for the disk twice.
#[test]
fn a_jog_keeps_its_old_values_before_the_first_write() {
    let mut bench = Bench::new("");
    let kept = Arc::new(Mutex::new(Vec::new()));
    bench.line.keep_old_values_in(Box::new(Lengths(kept.clone())));
    bench.jog(1e-3).unwrap();
    let kept = kept.lock().unwrap();
    assert!(
        kept[0] > 6 && kept.len() == 4,
        "the reduced values, the limits, the mode, and nothing in the end: {kept:?}"
    );
    assert_eq!(kept.last(), Some(&0));
}

/// A ledger that counts.
struct Lengths(Arc<Mutex<Vec<usize>>>);

impl Ledger for Lengths {
    fn keep(&mut self, _: usize, values: &[OldValue]) -> io::Result<()> {
        self.0.lock().unwrap().push(values.len());
        Ok(())
    }
}

/// The ledger drops a value that a drive never takes; the other values return.
#[test]
fn a_refused_old_value_does_not_stay_in_the_ledger() {
    let mut bench = Bench::new("");
    let notes = Notes::default();
    bench.line.keep_old_values_in(Box::new(notes.clone()));
    let old =
        |index, value, bytes| OldValue { object: ObjectKey(ObjectAddress::new(index, 0)), value, bytes };
    let (good, bad) = (old(0x6081, 77, 4), old(0x6098, 99, 1));
    assert_eq!(give_back(&mut bench.line, L1, &[good, bad]).unwrap(), [bad]);
    assert_eq!(bench.line.read_number(L1, good.object.0).unwrap(), 77);
    assert!(notes.0.lock().unwrap().is_empty());
}

/// A drive that takes the value of one object for another: no drive gets power, and the refusal has both values.
#[test]
fn a_loan_that_a_drive_does_not_keep_is_refused_before_power() {
    for object in ["1016h:01", "6007h", "605Ah", "605Eh", "6065h", "6066h", "6072h", "607Dh:01", "607Ah"] {
        let quirk =
            format!("[[drives.quirk]]\nkind = 'shows'\nobjects = ['{object}']\nvalue = 165\naxes = ['l1']");
        let mut bench = Bench::new(&quirk);
        let refusal = bench.jog(1e-3).unwrap_err();
        let text = refusal.to_string();
        let first = if object.ends_with('h') { format!("{object}:00h") } else { format!("{object}h") };
        assert!(text.starts_with(&format!("l1: object {first} (")), "{text}");
        assert!(text.contains(": the drive acknowledged it and shows "), "{text}");
        assert!(!bench.log.controlwords().iter().any(|(_, word)| word.0 & 1 == 1), "{object}: it had power");
    }
}
