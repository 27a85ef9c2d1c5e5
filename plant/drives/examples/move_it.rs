//! A master enables a drive and moves it by 10 mm in cyclic synchronous position: `cargo run --example move_it`.

use std::error::Error;

use masseter_can::canopen::{Cob, Nmt, NmtCommand, NmtTarget, NodeId, sync};
use masseter_can::cia402::{Controlword, DriveRequest, DriveState, next_controlword};
use masseter_can::{Bus, PdoMapping, Rpdo1, Tpdo1};
use masseter_drives::{DriveSettings, Stand};

const MILLISECOND_NS: u64 = 1_000_000;
/// 0.1 m/s, increments of a micrometre each millisecond.
const SPEED: i32 = 100;
const WAY: i32 = 10_000;

/// A cycle of the master: SYNC, the drive's answer, the next command. Returns the answer.
fn cycle(stand: &mut Stand, now_ns: &mut u64, node: NodeId, command: Rpdo1) -> Result<Tpdo1, Box<dyn Error>> {
    stand.master().send(*now_ns, command.frame(node, &PdoMapping::RPDO1))?;
    stand.master().send(*now_ns, sync::frame())?;
    *now_ns += MILLISECOND_NS;
    stand.advance(*now_ns);
    let mut answer = None;
    while let Some(received) = stand.master().receive(*now_ns)? {
        if received.frame.id() == Cob::Tpdo1(node).into() {
            answer = Some(Tpdo1::decode(received.frame.data(), &PdoMapping::TPDO1)?);
        }
    }
    answer.ok_or_else(|| "no answer to SYNC".into())
}

fn main() -> Result<(), Box<dyn Error>> {
    let node = NodeId::new(4)?;
    let mut stand = Stand::new(&[DriveSettings::new(node)])?;
    // A load of 20 N pulls towards smaller positions.
    stand.mass(0).load_n = 20.0;
    let mut now_ns = 25 * MILLISECOND_NS;
    stand.advance(now_ns);
    let start = Nmt { command: NmtCommand::Start, target: NmtTarget::All };
    stand.master().send(now_ns, start.frame())?;

    let mut command =
        Rpdo1 { controlword: Controlword::DISABLE_VOLTAGE, target_increments: 0, torque_offset_permille: 0 };
    let mut end = None;
    for number in 0..250 {
        let answer = cycle(&mut stand, &mut now_ns, node, command)?;
        let state = answer.statusword.state()?;
        command.controlword = next_controlword(state, DriveRequest::Enable, command.controlword);
        if state != DriveState::OperationEnabled {
            command.target_increments = answer.actual_increments;
        }
        let end = *end.get_or_insert(answer.actual_increments + WAY);
        if state == DriveState::OperationEnabled {
            command.target_increments = (command.target_increments + SPEED).min(end);
        }
        if number % 25 == 0 {
            let Tpdo1 { actual_increments, torque_permille, .. } = answer;
            println!("cycle {number}: {state}, {actual_increments} increments, {torque_permille} ‰");
        }
    }
    let (end, position_m) = (end.ok_or("no cycle")?, stand.mass(0).position_m);
    assert!((position_m - f64::from(end) * 1e-6).abs() < 1e-5, "{position_m} m");
    println!("the axis is at {:.2} mm", position_m * 1e3);
    Ok(())
}

#[test]
fn the_example_runs() {
    main().unwrap();
}
