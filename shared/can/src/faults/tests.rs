//! The frames that faults act on, and the reports on faults.

use super::*;

fn corrupt(probability: f64) -> Fault {
    Fault {
        number: 0,
        kind: FaultKind::Corrupt,
        from_ns: 1000,
        until_ns: 2000,
        id: None,
        port: None,
        probability,
        count: u64::MAX,
    }
}

fn id(number: u16) -> CanId {
    CanId::standard(number).unwrap()
}

fn acts_on(faults: &Faults, now_ns: u64, port: usize, number: u64) -> bool {
    faults.corrupts(NumberedFrame { at_ns: now_ns, port, id: id(0x181), number }).is_some()
}

#[test]
fn a_fault_acts_within_its_time_on_its_port_and_its_identifier() {
    let fault = Fault { port: Some(2), id: Some(id(0x181)), ..corrupt(1.0) };
    let faults = Faults::new(vec![fault], 1);
    assert!(acts_on(&faults, 1000, 2, 0));
    assert!(!acts_on(&faults, 999, 2, 0) && !acts_on(&faults, 2000, 2, 0));
    assert!(!acts_on(&faults, 1000, 1, 0));
    let other = Faults::new(vec![Fault { id: Some(id(0x182)), ..fault }], 1);
    assert!(!acts_on(&other, 1000, 2, 0));
}

#[test]
fn the_share_of_frames_acted_on_is_the_probability_and_the_seed_chooses_them() {
    let chosen = |seed| {
        let faults = Faults::new(vec![corrupt(0.1)], seed);
        (0..100_000).filter(|&number| acts_on(&faults, 1500, 0, number)).collect::<Vec<_>>()
    };
    let share = chosen(1).len() as f64 / 100_000.0;
    assert!((0.095..0.105).contains(&share), "{share}");
    assert_eq!(chosen(1), chosen(1));
    assert_ne!(chosen(1), chosen(2));
}

#[test]
fn a_fault_selects_frames_by_its_own_number_independent_of_other_faults() {
    let (first, second) = (Fault { number: 3, ..corrupt(0.1) }, Fault { number: 8, ..corrupt(0.1) });
    let chosen = |faults: Vec<Fault>| {
        let faults = Faults::new(faults, 1);
        (0..1000).filter(|&number| acts_on(&faults, 1500, 0, number)).collect::<Vec<_>>()
    };
    let lose = Fault { kind: FaultKind::Lose, ..first };
    assert_eq!(chosen(vec![lose, second]), chosen(vec![second]));
    assert_ne!(chosen(vec![first]), chosen(vec![second]));

    let mut faults = Faults::new(vec![second], 1);
    faults.record(FaultActivation { place: 0, at_ns: 1200 });
    assert_eq!(faults.next_note(1500).map(|note| note.fault), Some(8));
}

#[test]
fn a_fault_is_reported_once_at_its_begin_and_once_at_its_end() {
    let mut faults = Faults::new(vec![Fault { count: 2, ..corrupt(1.0) }], 1);
    assert_eq!(faults.next_note(1500), None);
    let activation = |at_ns| FaultActivation { place: 0, at_ns };
    faults.record(activation(1200));
    let note = FaultNote { time_ns: 1200, fault: 0, port: None, activations: 0, has_ended: false };
    assert_eq!(faults.next_note(1500), Some(note));
    assert_eq!(faults.next_note(1500), None);
    faults.record(activation(1300));
    let note = FaultNote { time_ns: 1500, activations: 2, has_ended: true, ..note };
    assert_eq!(faults.next_note(1500), Some(note));
    assert_eq!(faults.next_note(3000), None);
}
