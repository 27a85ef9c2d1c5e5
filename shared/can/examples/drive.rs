//! A master enables a drive (CiA 402) on a simulated wire. The master reads an object by SDO, then exchanges SYNC and
//! process data until the drive follows its target. A fault destroys one frame, which its sender repeats. The log of
//! the wire goes to standard output.
//!
//! `cargo run --release --example drive -p masseter-can`. The example needs no CAN interface, and gives the same log
//! every time.

use std::error::Error;

use masseter_can::canopen::{Cob, Expedited, NodeId, ObjectAddress, SdoRequest, SdoResponse, sync};
use masseter_can::cia402::{Controlword, DriveRequest, DriveState, Statusword, next_controlword};
use masseter_can::faults::{Fault, FaultKind, Faults};
use masseter_can::{
    Bitrate, Bus, Frame, PdoMapping, Received, Rpdo1, Tapped, Tpdo1, VirtualWire, WireConfig, candump,
};

const MASTER: usize = 0;
const DRIVE: usize = 1;
const CYCLE_NS: u64 = 1_000_000;
const TARGET: i32 = 1000;
/// Object 1000h:00h, with the profile's number: 402.
const DEVICE_TYPE: ObjectAddress = ObjectAddress::new(0x1000, 0);
const PROFILE: u32 = 402;

/// A drive that is at its target at once.
struct Drive {
    node: NodeId,
    state: DriveState,
    controlword: Controlword,
    increments: i32,
}

impl Drive {
    fn answer(&mut self, frame: &Frame) -> Result<Option<Frame>, Box<dyn Error>> {
        match Cob::try_from(frame.id())? {
            Cob::Sync => Ok(Some(self.process_data().frame(self.node, &PdoMapping::TPDO1))),
            Cob::SdoRequest(node) if node == self.node => {
                Ok(read(SdoRequest::decode(frame.data())?).map(|answer| answer.frame(node)))
            }
            Cob::Rpdo1(node) if node == self.node => {
                self.apply_process_data(Rpdo1::decode(frame.data(), &PdoMapping::RPDO1)?);
                Ok(None)
            }
            _ => Ok(None),
        }
    }

    fn process_data(&self) -> Tpdo1 {
        let statusword = Statusword::for_state(self.state);
        Tpdo1 { statusword, actual_increments: self.increments, torque_permille: 0 }
    }

    fn apply_process_data(&mut self, Rpdo1 { controlword, target_increments, .. }: Rpdo1) {
        self.state = self.state.after(controlword.command(self.controlword, self.state));
        self.controlword = controlword;
        if self.state == DriveState::OperationEnabled {
            self.increments = target_increments;
        }
    }
}

/// The answer of the object dictionary, which holds the device type.
fn read(request: SdoRequest) -> Option<SdoResponse> {
    let SdoRequest::InitiateUpload { object: DEVICE_TYPE } = request else { return None };
    let data = Expedited::new(&PROFILE.to_le_bytes())?;
    Some(SdoResponse::Upload { object: DEVICE_TYPE, data })
}

/// Sends a frame of the master and lets the drive answer until the wire is idle; the answer, if one came.
fn exchange(
    wire: &mut VirtualWire,
    drive: &mut Drive,
    now_ns: u64,
    frame: Frame,
) -> Result<Option<Frame>, Box<dyn Error>> {
    wire.port(MASTER).send(now_ns, frame)?;
    while let Some(event_ns) = wire.next_event_ns() {
        wire.advance(event_ns);
        while let Some(Received { frame, time_ns }) = wire.port(DRIVE).receive(event_ns)? {
            if let Some(answer) = drive.answer(&frame)? {
                wire.port(DRIVE).send(time_ns, answer)?;
            }
        }
    }
    Ok(wire.port(MASTER).receive(now_ns + CYCLE_NS)?.map(|received| received.frame))
}

fn main() -> Result<(), Box<dyn Error>> {
    let node = NodeId::new(5)?;
    let config = WireConfig {
        bitrate: Bitrate::MAX,
        ports: 2,
        transmit_capacity: 8,
        receive_capacity: 64,
        restart_after_ns: None,
    };
    let destroys_a_target = Fault {
        number: 0,
        kind: FaultKind::Corrupt,
        from_ns: 0,
        until_ns: u64::MAX,
        id: Some(Cob::Rpdo1(node).into()),
        port: None,
        probability: 1.0,
        count: 1,
    };
    let mut wire = VirtualWire::with_faults(&config, Faults::new(vec![destroys_a_target], 1));
    let mut drive = Drive {
        node,
        state: DriveState::SwitchOnDisabled,
        controlword: Controlword::DISABLE_VOLTAGE,
        increments: 0,
    };

    let request = SdoRequest::InitiateUpload { object: DEVICE_TYPE }.frame(node);
    let answer = exchange(&mut wire, &mut drive, 0, request)?.ok_or("no answer to the SDO request")?;
    let SdoResponse::Upload { data, .. } = SdoResponse::decode(answer.data())? else {
        return Err("the drive refused to tell its type".into());
    };
    println!("device type {:02X?}", data.data());

    let mut controlword = Controlword::DISABLE_VOLTAGE;
    for cycle in 1.. {
        let sync_ns = cycle * CYCLE_NS;
        let answer = exchange(&mut wire, &mut drive, sync_ns, sync::frame())?.ok_or("no answer to SYNC")?;
        let Tpdo1 { statusword, actual_increments, .. } = Tpdo1::decode(answer.data(), &PdoMapping::TPDO1)?;
        println!("cycle {cycle}: {}, {actual_increments} increments", statusword.state()?);
        if actual_increments == TARGET {
            break;
        }
        controlword = next_controlword(statusword.state()?, DriveRequest::Enable, controlword);
        let target = Rpdo1 { controlword, target_increments: TARGET, torque_offset_permille: 0 };
        exchange(&mut wire, &mut drive, sync_ns + CYCLE_NS / 2, target.frame(node, &PdoMapping::RPDO1))?;
    }

    while let Some(tapped) = wire.tap(u64::MAX)? {
        let mut line = String::new();
        candump::write(&mut line, "wire", &tapped)?;
        println!("{line}{}", if let Tapped::Error(_) = tapped { "  an error frame" } else { "" });
    }
    Ok(())
}

#[test]
fn the_example_runs() {
    main().unwrap();
}
