//! The non-volatile memory of a drive.

use super::*;

#[test]
fn what_a_drive_has_stored_is_there_when_it_is_switched_on_again() {
    let mut bench = Bench::new();
    assert_eq!(bench.drive.changed_memory(), None);
    bench.write((0x6065, 0), &777_u32.to_le_bytes()).unwrap();
    bench.write((0x607C, 0), &(-5_i32).to_le_bytes()).unwrap();
    bench.write((0x1010, 1), b"save").unwrap();
    let memory = bench.drive.changed_memory().unwrap();
    let stored: Vec<_> = memory.values.iter().map(|(key, value)| (key.as_str(), *value)).collect();
    assert_eq!((memory.serial_number, stored), (Some(4), vec![("6065:00", 777), ("607C:00", -5)]));

    let memory = DriveMemory { serial_number: Some(77), ..memory };
    let mut bench = Bench::with(&DriveSettings { memory, ..settings() });
    assert_eq!((bench.read((0x6065, 0)), bench.read((0x607C, 0))), (Ok(777), Ok(-5_i32 as u32)));
    assert_eq!(bench.read((0x1018, 4)), Ok(77));
    bench.write((0x1011, 1), b"load").unwrap();
    let memory = bench.drive.changed_memory().unwrap();
    assert!(memory.values.is_empty(), "as delivered: {memory:?}");
}

#[test]
fn a_memory_that_the_drive_does_not_take_is_refused_with_its_object() {
    for (key, value) in
        [("6065:09", 1), ("2000:00", 1), ("x", 1), ("6007:00", 9), ("6041:00", 1), ("60C2:01", 257)]
    {
        let memory = DriveMemory { serial_number: None, values: [(key.to_owned(), value)].into() };
        let settings = DriveSettings { memory, ..settings() };
        let refusal = DriveNode::new(&settings, 0, 0.27).unwrap_err().to_string();
        assert!(refusal.starts_with(key), "{refusal}");
    }
}
