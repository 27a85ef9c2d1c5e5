//! A drive with a quirk, a fault of the drive, and a fault of the wire, each from the side of the master:
//! `cargo run --example make_it_fail`.

use std::error::Error;

use masseter_can::canopen::{Cob, Emergency, Expedited, NodeId, ObjectAddress, SdoRequest, SdoResponse};
use masseter_can::cia402::DriveState;
use masseter_can::faults::{Fault, FaultKind, Faults};
use masseter_can::{Bitrate, Bus, Frame, Tapped, VirtualWire, WireConfig};
use masseter_drives::{DriveFault, DriveSettings, Quirk, Stand};

const MILLISECOND_NS: u64 = 1_000_000;
const CONTROLWORD: ObjectAddress = ObjectAddress::new(0x6040, 0);
const FOLLOWING_TIMEOUT: ObjectAddress = ObjectAddress::new(0x6066, 0);

/// The frames that the drive sends within 10 ms after a write by SDO.
fn write(
    stand: &mut Stand,
    now_ns: &mut u64,
    node: NodeId,
    object: ObjectAddress,
    value: u16,
) -> Result<Vec<Frame>, Box<dyn Error>> {
    let data = Expedited::new(&value.to_le_bytes()).ok_or("two bytes fit into one frame")?;
    stand.master().send(*now_ns, SdoRequest::Download { object, data }.frame(node))?;
    *now_ns += 10 * MILLISECOND_NS;
    stand.advance(*now_ns);
    let mut frames = Vec::new();
    while let Some(received) = stand.master().receive(*now_ns)? {
        frames.push(received.frame);
    }
    Ok(frames)
}

fn main() -> Result<(), Box<dyn Error>> {
    let node = NodeId::new(4)?;
    // The wire destroys the drive's second answer; the controller of the drive sends the frame again.
    let destroyed = Fault {
        number: 0,
        kind: FaultKind::Corrupt,
        from_ns: 30 * MILLISECOND_NS,
        until_ns: u64::MAX,
        id: Some(Cob::SdoResponse(node).into()),
        port: None,
        probability: 1.0,
        count: 1,
    };
    let config = WireConfig {
        bitrate: Bitrate::MAX,
        ports: 2,
        transmit_capacity: 8,
        receive_capacity: 64,
        restart_after_ns: None,
    };
    let wire = VirtualWire::with_faults(&config, Faults::new(vec![destroyed], 1));
    // A drive that refuses every time-out of the following error but 0.
    let settings = DriveSettings { quirks: vec![Quirk::NarrowLimits], ..DriveSettings::new(node) };
    let mut stand = Stand::on_wire(wire, &[settings])?;
    let mut now_ns = 25 * MILLISECOND_NS;
    stand.advance(now_ns);

    let frames = write(&mut stand, &mut now_ns, node, FOLLOWING_TIMEOUT, 20)?;
    let answer = frames.iter().find(|frame| frame.id() == Cob::SdoResponse(node).into());
    let answer = SdoResponse::decode(answer.ok_or("no answer")?.data())?;
    let SdoResponse::Abort { code, .. } = answer else { return Err(format!("{answer:?}").into()) };
    println!("the quirk: {FOLLOWING_TIMEOUT} = 20 is refused: {code}");

    for word in [0x06, 0x07, 0x0F] {
        write(&mut stand, &mut now_ns, node, CONTROLWORD, word)?;
    }
    assert_eq!(stand.drive(0).state(), DriveState::OperationEnabled);
    let mut errors = 0;
    while let Some(tapped) = stand.tap(now_ns)? {
        errors += usize::from(matches!(tapped, Tapped::Error(_)));
    }
    assert_eq!(errors, 1);
    println!("the wire: {errors} error frame, and the drive is enabled");

    stand.drive(0).set_fault(DriveFault::Fault, Some(0.0));
    let frames = write(&mut stand, &mut now_ns, node, CONTROLWORD, 0x0F)?;
    let emergency = frames.iter().find(|frame| frame.id() == Cob::Emergency(node).into());
    let emergency = Emergency::decode(emergency.ok_or("no emergency")?.data())?;
    assert_eq!(stand.drive(0).state(), DriveState::Fault);
    assert!(stand.drive(0).faults().has_struck(DriveFault::Fault));
    println!("the drive: in fault, emergency {:?}", emergency.code);

    stand.drive(0).set_fault(DriveFault::Fault, None);
    write(&mut stand, &mut now_ns, node, CONTROLWORD, 0x80)?;
    assert_eq!(stand.drive(0).state(), DriveState::SwitchOnDisabled);
    println!("a fault reset: {}", stand.drive(0).state());
    Ok(())
}

#[test]
fn the_example_runs() {
    main().unwrap();
}
