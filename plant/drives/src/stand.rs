//! Drives on a simulated wire, each of which moves a mass: a test stand without a machine.
//!
//! The stand is a pure step function: the caller gives the time. Encoders have no noise, and masses do not touch each other.
//! A caller with mechanics of its own steps each [`DriveNode`] itself.

use masseter_can::canopen::Cob;
use masseter_can::{
    Bitrate, Bus, CanId, ErrorState, Frame, Port, ReceiveError, Tapped, VirtualWire, WireConfig,
};

use crate::settings::{DriveSettings, SettingsError};
use crate::{axis::encoder::Look, node::DriveNode};

/// Frames that a port can hold for sending, and for receiving between two looks; a millisecond holds 21.
const TRANSMIT_CAPACITY: usize = 64;
const RECEIVE_CAPACITY: usize = 256;
/// How far behind the ends of its stroke an axis has its stops, m.
const STOPS_BEHIND_M: f64 = 2e-3;
/// Stiffness of a stop, N/m, and its damping, N per m/s.
const STOP_N_PER_M: f64 = 1e6;
const STOP_N_S_PER_M: f64 = 1e3;

/// A mass on a straight axis between two stops. The fields may be changed at any time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mass {
    /// Its mass, kg.
    pub mass_kg: f64,
    /// A force on it towards smaller positions, N.
    pub load_n: f64,
    /// The stops, m.
    pub stops_m: [f64; 2],
    /// Its position, m.
    pub position_m: f64,
    /// Its velocity, m/s.
    pub velocity_m_s: f64,
}

impl Mass {
    /// Moves under a force, N, for a time, s. The time is short: a step of the servo loops.
    pub fn advance(&mut self, force_n: f64, time_s: f64) {
        let [low_m, high_m] = self.stops_m;
        let depth_m = (low_m - self.position_m).max(0.0) - (self.position_m - high_m).max(0.0);
        let damped_n = if depth_m == 0.0 { 0.0 } else { STOP_N_S_PER_M * self.velocity_m_s };
        let force_n = force_n - self.load_n + STOP_N_PER_M * depth_m - damped_n;
        self.velocity_m_s += force_n / self.mass_kg * time_s;
        self.position_m += self.velocity_m_s * time_s;
    }
}

/// The encoder of a drive. The fields may be changed at any time.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Encoder {
    /// How much more than the position the encoder shows, m.
    pub error_m: f64,
    /// The position that the encoder shows all the time, m; `None` where the encoder works.
    pub stuck_m: Option<f64>,
}

impl Encoder {
    fn look(self, at_m: f64) -> Look {
        Look::exact(self.stuck_m.unwrap_or(at_m + self.error_m))
    }
}

/// A drive with its mass.
#[derive(Debug, Clone)]
struct Axle {
    drive: DriveNode,
    mass: Mass,
    encoder: Encoder,
    /// The drive's force since its last step, N.
    force_n: f64,
    moved_to_ns: u64,
    step_ns: u64,
    next_step_ns: u64,
}

impl Axle {
    fn new(settings: &DriveSettings) -> Result<Self, SettingsError> {
        let [low_m, high_m] = settings.stroke_m;
        let position_m = f64::midpoint(low_m, high_m);
        let stops_m = [low_m - STOPS_BEHIND_M, high_m + STOPS_BEHIND_M];
        Ok(Self {
            drive: DriveNode::new(settings, 0, position_m)?,
            mass: Mass { mass_kg: 0.6, load_n: 0.0, stops_m, position_m, velocity_m_s: 0.0 },
            encoder: Encoder::default(),
            force_n: 0.0,
            moved_to_ns: 0,
            step_ns: settings.step_ns,
            next_step_ns: settings.step_ns,
        })
    }

    fn move_to(&mut self, now_ns: u64) {
        self.mass.advance(self.force_n, (now_ns - self.moved_to_ns) as f64 * 1e-9);
        self.moved_to_ns = now_ns;
    }

    fn deliver(&mut self, now_ns: u64, frame: &Frame) {
        if frame.id() == CanId::from(Cob::Sync) {
            self.move_to(now_ns);
            self.drive.take_sync(now_ns, frame, self.mass.position_m, |at_m| self.encoder.look(at_m));
        } else {
            self.drive.receive(now_ns, frame);
        }
    }

    fn step(&mut self, now_ns: u64, state: ErrorState) {
        self.move_to(now_ns);
        self.drive.set_error_state(now_ns, state);
        self.force_n = self.drive.step(now_ns, self.mass.position_m, |at_m| self.encoder.look(at_m));
        self.drive.compare_encoders(now_ns, self.mass.position_m);
        self.next_step_ns += self.step_ns;
    }
}

/// Drives on a simulated wire with a port for their master.
///
/// ```
/// use masseter_can::Bus;
/// use masseter_can::canopen::{Cob, NodeId, ObjectAddress, SdoRequest};
/// use masseter_drives::{DriveSettings, Stand};
///
/// let node = NodeId::new(4)?;
/// let mut stand = Stand::new(&[DriveSettings::new(node)])?;
/// let boot_ns = 25_000_000;
/// stand.advance(boot_ns);
/// let statusword = ObjectAddress::new(0x6041, 0);
/// stand.master().send(boot_ns, SdoRequest::InitiateUpload { object: statusword }.frame(node))?;
/// stand.advance(boot_ns + 1_000_000);
/// let boot_up = stand.master().receive(boot_ns)?.ok_or("the drive is silent")?;
/// assert_eq!(Cob::try_from(boot_up.frame.id())?, Cob::Heartbeat(node));
/// let answer = stand.master().receive(boot_ns + 1_000_000)?.ok_or("no answer")?;
/// assert_eq!(answer.frame.data()[1..3], [0x41, 0x60]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Stand {
    wire: VirtualWire,
    axles: Vec<Axle>,
}

impl Stand {
    /// The port of the master. The drives' ports follow in their order.
    pub const MASTER: usize = 0;

    /// Drives that are switched on at time 0 on a wire of 1 Mbit/s, each in the middle of its stroke.
    ///
    /// # Errors
    /// [`SettingsError`].
    ///
    /// # Panics
    /// With more than 127 drives, which one wire does not carry.
    pub fn new(settings: &[DriveSettings]) -> Result<Self, SettingsError> {
        let wire = VirtualWire::new(&WireConfig {
            bitrate: Bitrate::MAX,
            ports: 1 + settings.len(),
            transmit_capacity: TRANSMIT_CAPACITY,
            receive_capacity: RECEIVE_CAPACITY,
            restart_after_ns: None,
        });
        Self::on_wire(wire, settings)
    }

    /// The same on a wire of the caller, which may have another bit rate, faults, and ports for other nodes.
    ///
    /// # Errors
    /// [`SettingsError`].
    pub fn on_wire(wire: VirtualWire, settings: &[DriveSettings]) -> Result<Self, SettingsError> {
        Ok(Self { wire, axles: settings.iter().map(Axle::new).collect::<Result<_, _>>()? })
    }

    /// The port of the master.
    pub fn master(&mut self) -> Port<'_> {
        self.wire.port(Self::MASTER)
    }

    /// The wire, with all ports and the tap.
    pub fn wire(&mut self) -> &mut VirtualWire {
        &mut self.wire
    }

    /// A drive, by its place in the settings: to read its state, and to set its faults.
    ///
    /// # Panics
    /// Where there is no such drive.
    pub fn drive(&mut self, place: usize) -> &mut DriveNode {
        &mut self.axles[place].drive
    }

    /// The mass that a drive moves.
    ///
    /// # Panics
    /// Where there is no such drive.
    pub fn mass(&mut self, place: usize) -> &mut Mass {
        &mut self.axles[place].mass
    }

    /// The encoder of a drive.
    ///
    /// # Panics
    /// Where there is no such drive.
    pub fn encoder(&mut self, place: usize) -> &mut Encoder {
        &mut self.axles[place].encoder
    }

    /// The next frame or error on the wire up to `now_ns`, of any node.
    ///
    /// # Errors
    /// [`ReceiveError::Overrun`] for frames lost because nobody looked for long; no other.
    pub fn tap(&mut self, now_ns: u64) -> Result<Option<Tapped>, ReceiveError> {
        self.wire.tap(now_ns)
    }

    /// Simulates everything up to `until_ns`, event by event. A time already passed changes nothing.
    pub fn advance(&mut self, until_ns: u64) {
        while let Some(now_ns) = self.next_event_ns().filter(|now_ns| *now_ns <= until_ns) {
            self.wire.advance(now_ns);
            for (number, axle) in (Self::MASTER + 1..).zip(&mut self.axles) {
                let mut port = self.wire.port(number);
                // An overrun loses the drive's newest frames, as in a real node; the older ones follow.
                while let Ok(Some(received)) = port.receive(now_ns) {
                    axle.deliver(now_ns, &received.frame);
                }
                if axle.next_step_ns == now_ns {
                    axle.step(now_ns, port.status().state);
                }
                while let Some(frame) = axle.drive.outgoing() {
                    // A full queue or a controller in bus-off loses the frame, as in a real node.
                    let _ = port.send(now_ns, frame);
                }
            }
        }
        self.wire.advance(until_ns);
    }

    /// The next arrival of a frame, or the next step of a drive.
    fn next_event_ns(&mut self) -> Option<u64> {
        let steps_ns = self.axles.iter().map(|axle| axle.next_step_ns);
        steps_ns.chain(self.wire.next_event_ns()).min()
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::canopen::{Heartbeat, Nmt, NmtCommand, NmtState, NmtTarget, NodeId, sync};
    use masseter_can::cia402::{Controlword, DriveRequest, DriveState, next_controlword};
    use masseter_can::{PdoMapping, Rpdo1, Tpdo1};

    use super::*;

    const MS: u64 = 1_000_000;

    fn nodes() -> [NodeId; 2] {
        [4, 5].map(|id| NodeId::new(id).unwrap())
    }

    /// Two drives that are operational, without supervision of the master.
    fn operational() -> (Stand, u64) {
        let settings = nodes().map(|node| DriveSettings { master_timeout_ms: 0, ..DriveSettings::new(node) });
        let (mut stand, now_ns) = (Stand::new(&settings).unwrap(), 25 * MS);
        stand.advance(now_ns);
        let start = Nmt { command: NmtCommand::Start, target: NmtTarget::All };
        stand.master().send(now_ns, start.frame()).unwrap();
        (stand, now_ns)
    }

    /// A cycle of a master that enables both drives and sends them to a position, increments.
    fn cycle(stand: &mut Stand, now_ns: &mut u64, words: &mut [Controlword; 2], target: i32) {
        stand.master().send(*now_ns, sync::frame()).unwrap();
        *now_ns += MS;
        stand.advance(*now_ns);
        while let Some(received) = stand.master().receive(*now_ns).unwrap() {
            let cob = Cob::try_from(received.frame.id()).unwrap();
            let Some(place) = nodes().iter().position(|node| cob == Cob::Tpdo1(*node)) else { continue };
            let answer = Tpdo1::decode(received.frame.data(), &PdoMapping::TPDO1).unwrap();
            words[place] =
                next_controlword(answer.statusword.state().unwrap(), DriveRequest::Enable, words[place]);
            let command =
                Rpdo1 { controlword: words[place], target_increments: target, torque_offset_permille: 0 };
            stand.master().send(*now_ns, command.frame(nodes()[place], &PdoMapping::RPDO1)).unwrap();
        }
    }

    #[test]
    fn two_drives_boot_on_one_wire() {
        let settings = nodes().map(DriveSettings::new);
        let mut stand = Stand::new(&settings).unwrap();
        stand.advance(25 * MS);
        let mut booted = Vec::new();
        while let Some(received) = stand.master().receive(25 * MS).unwrap() {
            booted.push((received.frame.id(), Heartbeat::decode(received.frame.data()).unwrap().state));
        }
        assert_eq!(booted, nodes().map(|node| (Cob::Heartbeat(node).into(), NmtState::BootUp)));
    }

    #[test]
    fn both_drives_follow_their_master_and_carry_their_loads() {
        let (mut stand, mut now_ns) = operational();
        stand.mass(1).load_n = 50.0;
        let mut words = [Controlword::DISABLE_VOLTAGE; 2];
        for target in (0..400).map(|cycle| 150_000 + 100 * (cycle - 50).clamp(0, 300)) {
            cycle(&mut stand, &mut now_ns, &mut words, target);
        }
        for place in [0, 1] {
            assert_eq!(stand.drive(place).state(), DriveState::OperationEnabled);
            assert!((stand.mass(place).position_m - 0.18).abs() < 1e-5, "{:?}", stand.mass(place));
        }
    }

    #[test]
    fn a_time_already_passed_changes_nothing_and_a_clone_goes_on_alike() {
        let (mut stand, mut now_ns) = operational();
        let mut words = [Controlword::DISABLE_VOLTAGE; 2];
        (0..50).for_each(|_| cycle(&mut stand, &mut now_ns, &mut words, 151_000));
        stand.advance(now_ns / 2);
        let (mut other, mut other_ns, mut other_words) = (stand.clone(), now_ns, words);
        (0..50).for_each(|_| cycle(&mut stand, &mut now_ns, &mut words, 152_000));
        (0..50).for_each(|_| cycle(&mut other, &mut other_ns, &mut other_words, 152_000));
        assert_eq!(stand.mass(0), other.mass(0));
        assert!((stand.mass(0).position_m - 0.152).abs() < 1e-4, "{:?}", stand.mass(0));
    }

    #[test]
    fn an_encoder_with_an_error_leads_its_axis_away_and_a_stuck_one_is_noticed() {
        let (mut stand, mut now_ns) = operational();
        let mut words = [Controlword::DISABLE_VOLTAGE; 2];
        (0..100).for_each(|_| cycle(&mut stand, &mut now_ns, &mut words, 150_000));
        stand.encoder(0).error_m = 1e-4;
        (0..300).for_each(|_| cycle(&mut stand, &mut now_ns, &mut words, 150_000));
        assert!((stand.mass(0).position_m - 0.1499).abs() < 1e-5, "{:?}", stand.mass(0));
        stand.encoder(1).stuck_m = Some(0.15);
        // The master resets the fault at once.
        let is_noticed = (150_000..160_000).step_by(100).any(|target| {
            cycle(&mut stand, &mut now_ns, &mut words, target);
            stand.drive(1).state() == DriveState::Fault
        });
        assert!(is_noticed, "following error");
        assert_eq!(stand.drive(0).state(), DriveState::OperationEnabled);
    }

    #[test]
    fn a_wire_carries_every_node_of_canopen() {
        let settings: Vec<_> = (1..=127).map(|id| DriveSettings::new(NodeId::new(id).unwrap())).collect();
        let mut stand = Stand::new(&settings).unwrap();
        stand.advance(45 * MS);
        let mut booted = 0;
        while let Some(received) = stand.master().receive(45 * MS).unwrap() {
            let heartbeat = Heartbeat::decode(received.frame.data()).unwrap();
            booted += usize::from(heartbeat.state == NmtState::BootUp);
        }
        assert_eq!(booted, 127);
    }

    #[test]
    fn a_stop_holds_the_mass() {
        let mut mass =
            Mass { mass_kg: 0.6, load_n: 100.0, stops_m: [0.0, 1.0], position_m: 0.01, velocity_m_s: 0.0 };
        (0..8000).for_each(|_| mass.advance(0.0, 125e-6));
        assert!((mass.position_m + 1e-4).abs() < 1e-6, "100 N deep in the stop: {mass:?}");
    }
}
