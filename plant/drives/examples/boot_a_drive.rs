//! A drive boots on a simulated wire. A master reads its identity by SDO and starts it: `cargo run --example boot_a_drive`.

use std::error::Error;

use masseter_can::Bus;
use masseter_can::canopen::{
    Cob, Heartbeat, Nmt, NmtCommand, NmtState, NmtTarget, NodeId, ObjectAddress, SdoRequest, SdoResponse,
};
use masseter_drives::{DriveSettings, Identity, Stand};

const MILLISECOND_NS: u64 = 1_000_000;

/// The next frame for the master within 100 ms, with its time, ns.
fn receive(stand: &mut Stand, now_ns: &mut u64, cob: Cob) -> Result<Vec<u8>, Box<dyn Error>> {
    for _ in 0..100 {
        while let Some(received) = stand.master().receive(*now_ns)? {
            if received.frame.id() == cob.into() {
                return Ok(received.frame.data().to_vec());
            }
        }
        *now_ns += MILLISECOND_NS;
        stand.advance(*now_ns);
    }
    Err(format!("no {cob:?} within 100 ms").into())
}

fn main() -> Result<(), Box<dyn Error>> {
    let node = NodeId::new(4)?;
    let identity = Identity { product_code: 0x0402_0001, ..Identity::default() };
    let mut stand = Stand::new(&[DriveSettings { identity, ..DriveSettings::new(node) }])?;
    let mut now_ns = 0;

    let boot_up = receive(&mut stand, &mut now_ns, Cob::Heartbeat(node))?;
    assert_eq!(Heartbeat::decode(&boot_up)?.state, NmtState::BootUp);
    println!("{} ms: node {node} has booted", now_ns / MILLISECOND_NS);

    let request = SdoRequest::InitiateUpload { object: ObjectAddress::new(0x1018, 2) };
    stand.master().send(now_ns, request.frame(node))?;
    let answer = receive(&mut stand, &mut now_ns, Cob::SdoResponse(node))?;
    let SdoResponse::Upload { object, data } = SdoResponse::decode(&answer)? else {
        return Err(format!("refused: {answer:02X?}").into());
    };
    assert_eq!(data.data(), identity.product_code.to_le_bytes());
    println!("{} ms: {object} is {:02X?}", now_ns / MILLISECOND_NS, data.data());

    let start = Nmt { command: NmtCommand::Start, target: NmtTarget::Node(node) };
    stand.master().send(now_ns, start.frame())?;
    let heartbeat = receive(&mut stand, &mut now_ns, Cob::Heartbeat(node))?;
    assert_eq!(Heartbeat::decode(&heartbeat)?.state, NmtState::Operational);
    println!("{} ms: node {node} is operational", now_ns / MILLISECOND_NS);
    Ok(())
}

#[test]
fn the_example_runs() {
    main().unwrap();
}
