//! The object dictionary for a client.

use super::*;
use crate::dictionary::ENTRIES;
use crate::table::{Access, DataType};

/// The access, its object, its data, and the answer.
type Refusal<'a> = (&'a str, (u16, u8), &'a [u8], AbortCode);

/// Every abort code that an expedited transfer can meet, with a request that meets it.
#[test]
fn what_may_not_be_written_is_aborted_with_the_reason() {
    const SAVE: [u8; 4] = *b"save";
    let table: [Refusal<'_>; 40] = [
        ("no such object", (0x2000, 0), &[1], AbortCode::NO_OBJECT),
        ("no such sub-index", (0x1018, 5), &[1], AbortCode::NO_SUBINDEX),
        ("reserved sub-index", (0x1800, 4), &[1], AbortCode::NO_SUBINDEX),
        ("constant", (0x1000, 0), &[1, 0, 0, 0], AbortCode::READ_ONLY),
        ("actual value", POSITION, &[1, 0, 0, 0], AbortCode::READ_ONLY),
        ("too long", CONTROLWORD, &[6, 0, 0], AbortCode::TOO_LONG),
        ("too short", CONTROLWORD, &[6], AbortCode::TOO_SHORT),
        ("above the highest", (0x6007, 0), &[4, 0], AbortCode::TOO_HIGH),
        ("below the lowest", (0x6007, 0), &[0xFF, 0xFF], AbortCode::TOO_LOW),
        ("no velocity", (0x6081, 0), &[0; 4], AbortCode::TOO_LOW),
        ("interpolation faster than 1 µs", (0x60C2, 2), &[(-7_i8) as u8], AbortCode::TOO_LOW),
        ("velocity mode", MODE, &[2], AbortCode::INVALID_VALUE),
        ("quick stop at the current limit", (0x605A, 0), &[3, 0], AbortCode::INVALID_VALUE),
        ("homing onto the home switch", (0x6098, 0), &[7], AbortCode::INVALID_VALUE),
        ("limits crossed", (0x607D, 1), &400_000_i32.to_le_bytes(), AbortCode::MAXIMUM_BELOW_MINIMUM),
        ("limits crossed", (0x607D, 2), &[0; 4], AbortCode::MAXIMUM_BELOW_MINIMUM),
        ("history set to other than 0", (0x1003, 0), &[1], AbortCode::INVALID_VALUE),
        ("saved without signature", (0x1010, 1), &[1, 0, 0, 0], AbortCode::NOT_STORED),
        ("restored with the wrong one", (0x1011, 1), &SAVE, AbortCode::NOT_STORED),
        ("EMCY moved while it exists", (0x1014, 0), &0x90_u32.to_le_bytes(), AbortCode::INVALID_VALUE),
        (
            "EMCY with a long identifier",
            (0x1014, 0),
            &0xA000_0084_u32.to_le_bytes(),
            AbortCode::INVALID_VALUE,
        ),
        (
            "a node watched twice",
            (0x1016, 2),
            &0x007F_0064_u32.to_le_bytes(),
            AbortCode::PARAMETER_INCOMPATIBLE,
        ),
        ("SYNC counter to 1", (0x1019, 0), &[1], AbortCode::INVALID_VALUE),
        ("SYNC counter beyond 240", (0x1019, 0), &[241], AbortCode::TOO_HIGH),
        ("RPDO moved while it exists", (0x1400, 1), &0x210_u32.to_le_bytes(), AbortCode::INVALID_VALUE),
        ("PDO that carries nothing", (0x1401, 1), &0x304_u32.to_le_bytes(), AbortCode::INVALID_VALUE),
        ("PDO as an SDO", (0x1801, 1), &0x604_u32.to_le_bytes(), AbortCode::INVALID_VALUE),
        ("transmission type reserved", (0x1400, 2), &[245], AbortCode::INVALID_VALUE),
        ("remote request", (0x1800, 2), &[253], AbortCode::INVALID_VALUE),
        ("inhibit time of a PDO that exists", (0x1800, 3), &[10, 0], AbortCode::INVALID_VALUE),
        ("start value of a PDO that exists", (0x1800, 6), &[1], AbortCode::INVALID_VALUE),
        ("mapping of a PDO that exists", (0x1A00, 0), &[0], AbortCode::PARAMETER_INCOMPATIBLE),
        (
            "mapped object of a PDO that exists",
            (0x1600, 1),
            &0x6040_0010_u32.to_le_bytes(),
            AbortCode::PARAMETER_INCOMPATIBLE,
        ),
        ("more than eight mapped", (0x1601, 0), &[9], AbortCode::TOO_HIGH),
        ("an empty place mapped", (0x1601, 0), &[1], AbortCode::PARAMETER_INCOMPATIBLE),
        ("no object mapped", (0x1601, 1), &0x2000_0010_u32.to_le_bytes(), AbortCode::NO_OBJECT),
        ("no sub-index mapped", (0x1601, 1), &0x6040_0110_u32.to_le_bytes(), AbortCode::NO_SUBINDEX),
        ("not mappable", (0x1601, 1), &0x6065_0020_u32.to_le_bytes(), AbortCode::NOT_MAPPABLE),
        ("actual value received", (0x1601, 1), &0x6064_0020_u32.to_le_bytes(), AbortCode::NOT_MAPPABLE),
        ("half an object", (0x1601, 1), &0x607A_0010_u32.to_le_bytes(), AbortCode::NOT_MAPPABLE),
    ];
    for (what, object, data, code) in table {
        let mut bench = Bench::new();
        let before = bench.drive.objects.clone();
        assert_eq!(bench.write(object, data), Err(code), "{what}");
        assert!(bench.drive.objects == before, "{what}: nothing may have changed");
    }
}

#[test]
fn what_depends_on_the_state_is_aborted_in_the_wrong_one() {
    let mut bench = Bench::enabled(8);
    assert_eq!(bench.write((0x60C2, 1), &[2]), Err(AbortCode::DEVICE_STATE));
    assert_eq!(bench.write((0x1010, 1), b"save"), Err(AbortCode::DEVICE_STATE));
    bench.nmt(NmtCommand::Start);
    assert_eq!(bench.write((0x1019, 0), &[10]), Err(AbortCode::DEVICE_STATE));
}

#[test]
fn mapped_objects_must_fit_into_eight_bytes() {
    let mut bench = Bench::new();
    for (place, object) in (1..).zip([0x6040_0010_u32, 0x607A_0020, 0x6081_0020]) {
        bench.write((0x1601, place), &object.to_le_bytes()).unwrap();
    }
    assert_eq!(bench.write((0x1601, 0), &[3]), Err(AbortCode::PDO_LENGTH));
    bench.write((0x1601, 0), &[2]).unwrap();
    assert_eq!(
        bench.write((0x1601, 3), &[0; 4]),
        Err(AbortCode::PARAMETER_INCOMPATIBLE),
        "entries change while there are none"
    );
}

#[test]
fn every_entry_can_be_read_and_has_the_length_of_its_type() {
    let mut bench = Bench::new();
    for entry in &ENTRIES {
        let object = entry.address;
        let answer = bench.ask(SdoRequest::InitiateUpload { object }).expect("an answer");
        match (entry.kind, answer) {
            (DataType::Text, SdoResponse::InitiateUpload { size: Some(1..), .. })
            | (DataType::Domain, SdoResponse::InitiateUpload { size: Some(0), .. }) => {}
            (kind, SdoResponse::Upload { data, .. }) => {
                assert_eq!(data.data().len(), kind.bytes(), "{object}");
            }
            (_, SdoResponse::Abort { code, .. }) => {
                assert_eq!((object.index, code), (0x1003, AbortCode::NO_DATA), "{object}");
            }
            (_, other) => panic!("{object}: {other:?}"),
        }
    }
}

#[test]
fn what_may_be_written_can_be_written_as_it_was_read() {
    let by_signature_or_unmapped = [0x1010, 0x1011];
    for entry in ENTRIES.iter().filter(|entry| entry.access == Access::ReadWrite) {
        let object = (entry.address.index, entry.address.subindex);
        let is_live_pdo = matches!(object, (0x1600 | 0x1A00, _) | (0x1800, 3 | 6));
        if by_signature_or_unmapped.contains(&object.0) || is_live_pdo || entry.kind == DataType::Domain {
            continue;
        }
        let mut bench = Bench::new();
        let word = bench.read(object).unwrap().to_le_bytes();
        assert_eq!(bench.write(object, &word[..entry.kind.bytes()]), Ok(()), "{}", entry.address);
    }
}

#[test]
fn supported_modes_are_those_that_can_be_chosen() {
    let mut bench = Bench::new();
    let supported = bench.read((0x6502, 0)).unwrap();
    for mode in -128..=127_i8 {
        let is_supported = mode == 0 || (1..=32).contains(&mode) && supported >> (mode - 1) & 1 == 1;
        assert_eq!(bench.write(MODE, &[mode as u8]).is_ok(), is_supported, "mode {mode}");
    }
}

#[test]
fn mode_0_changes_nothing() {
    let mut bench = Bench::enabled(PROFILE_POSITION);
    bench.write(MODE, &[0]).unwrap();
    assert_eq!(bench.read((0x6061, 0)), Ok(PROFILE_POSITION as u32));
}

#[test]
fn stored_parameters_survive_a_reset_and_restored_ones_come_back_at_the_next() {
    let window = (0x6065, 0);
    let mut bench = Bench::new();
    let initial = bench.read(window).unwrap();
    let reboot = |bench: &mut Bench| {
        bench.nmt(NmtCommand::ResetNode);
        bench.run_ms(25);
        bench.read(window).unwrap()
    };
    bench.write(window, &777_u32.to_le_bytes()).unwrap();
    assert_eq!(reboot(&mut bench), initial, "a reboot restores the defaults");
    bench.write(window, &777_u32.to_le_bytes()).unwrap();
    bench.write((0x1010, 1), b"save").unwrap();
    assert_eq!(reboot(&mut bench), 777);
    bench.write((0x1011, 1), b"load").unwrap();
    assert_eq!(bench.read(window), Ok(777), "not before the reset");
    assert_eq!(reboot(&mut bench), initial);
}
