//! The CAN link, the drives and the mechanism's dynamics, as a scenario declares them.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use toml::Table;

use super::ScenarioError;
use crate::can::{Bitrate, BitrateError, FrameFormat, Rates};
use crate::geometry::{AXES, LEGS};

/// The CAN link between the master and the six drives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CanConfig {
    /// Real interfaces, one a bus, such as `["can0", "can1"]`; none for simulated buses.
    pub interfaces: Vec<String>,
    /// Bit rate of every bus, bit/s.
    pub bitrate_bps: u32,
    /// Whether a bit takes a nanosecond, whatever `bitrate_bps` says (simulated buses only): for cycles that no CAN
    /// holds.
    pub ideal: bool,
    /// Whether frames go in FD format with bit-rate switch. Real interfaces must have been set up for it.
    pub fd: bool,
    /// Bit rate of the data phase of FD frames, bit/s.
    pub data_bitrate_bps: u32,
    /// How long after bus-off a controller restarts by itself, ms; 0 for never (as `ip link … restart-ms`).
    /// On real interfaces only for faults of the scenario; their own setting holds otherwise.
    pub restart_ms: u32,
    /// Which axes (0 to 5: d₁ d₂ d₃ l₁ l₂ l₃) hang on which bus.
    pub buses: Vec<Vec<usize>>,
    /// Node id of each axis, in the axis order.
    pub node_ids: [u8; AXES],
    /// Heartbeat of the master and of every drive (object 1017), ms.
    pub heartbeat_producer_ms: u16,
    /// Silence after which a heartbeat counts as lost (object 1016), ms.
    pub heartbeat_consumer_ms: u16,
    /// From SYNC to the moment a drive has its process data ready to be sent, at most, µs; none for the
    /// emulated drives on simulated buses.
    pub answer_us: u32,
    /// What device every drive must be.
    pub identity: IdentityConfig,
    /// How long the drives may take to boot, ms.
    pub boot_timeout_ms: u32,
    /// Cycles without a fresh command after which the master quick-stops the drives.
    pub command_timeout_cycles: u32,
}

impl Default for CanConfig {
    fn default() -> Self {
        Self {
            interfaces: Vec::new(),
            bitrate_bps: 1_000_000,
            ideal: false,
            fd: false,
            data_bitrate_bps: 5_000_000,
            restart_ms: 100,
            buses: vec![vec![0, 1, 2], vec![3, 4, 5]],
            node_ids: [1, 2, 3, 4, 5, 6],
            heartbeat_producer_ms: 50,
            heartbeat_consumer_ms: 150,
            answer_us: 0,
            identity: IdentityConfig::default(),
            boot_timeout_ms: 2000,
            command_timeout_cycles: 20,
        }
    }
}

impl CanConfig {
    /// Whether the buses are simulated.
    pub fn is_virtual(&self) -> bool {
        self.interfaces.is_empty()
    }

    /// Bit rates of every bus.
    pub fn rates(&self) -> Result<Rates, BitrateError> {
        let nominal = Bitrate::new(self.bitrate_bps)?;
        if self.ideal {
            return Ok(Rates::classical(Bitrate::IDEAL));
        }
        if self.fd { Rates::switching(nominal, self.data_bitrate_bps) } else { Ok(Rates::classical(nominal)) }
    }

    /// The format of every frame.
    pub fn format(&self) -> FrameFormat {
        if self.fd { FrameFormat::FdBitRateSwitch } else { FrameFormat::Classical }
    }

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        if self.heartbeat_producer_ms == 0 {
            return Err(ScenarioError::BadValue {
                key: "can.heartbeat_producer_ms",
                value: "0".to_owned(),
                need: "use at least 1 ms: nodes are known to be alive by their heartbeats".to_owned(),
            });
        }
        if self.ideal && (self.fd || !self.is_virtual()) {
            return Err(ScenarioError::BadValue {
                key: "can.ideal",
                value: "true".to_owned(),
                need: "leave it away with can.fd and can.interfaces: it replaces their bit rates".to_owned(),
            });
        }
        if let Err(error) = self.rates() {
            let (key, bps) = match error {
                BitrateError::Nominal { bps } => ("can.bitrate_bps", bps),
                BitrateError::Data { bps, .. } => ("can.data_bitrate_bps", bps),
            };
            return Err(ScenarioError::BadValue { key, value: bps.to_string(), need: error.to_string() });
        }
        let names = &self.interfaces;
        let has_twice = (1..names.len()).any(|index| names[..index].contains(&names[index]));
        if self.is_virtual() || names.len() == self.buses.len() && !has_twice {
            return Ok(());
        }
        Err(ScenarioError::BadValue {
            key: "can.interfaces",
            value: names.join(","),
            need: format!("name {} interfaces, one for each of can.buses", self.buses.len()),
        })
    }
}

/// What a drive must say it is, before anything is written to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct IdentityConfig {
    /// Device type (object 1000).
    pub device_type: u32,
    /// Vendor (object 1018:01).
    pub vendor_id: u32,
    /// Product (object 1018:02).
    pub product_code: u32,
    /// Revision (object 1018:03).
    pub revision: u32,
}

impl IdentityConfig {
    /// The emulated drives: servo drives of CiA 402. The rig's makers have no vendor number of CiA's; this one is not
    /// registered.
    pub const EMULATED: Self = Self {
        device_type: 0x0002_0192,
        vendor_id: 0x004D_5354,
        product_code: 0x0000_0402,
        revision: 0x0001_0000,
    };
}

impl Default for IdentityConfig {
    fn default() -> Self {
        Self::EMULATED
    }
}

/// A servo drive with its encoder. Scales and limits hold for real ones too, gains and noise for emulated ones.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveConfig {
    /// Force at 1000 ‰ of the torque objects (6077), N.
    pub rated_force_n: f64,
    /// Force limit of the drive, N.
    pub max_force_n: f64,
    /// Velocity limit of the drive, m/s.
    pub max_velocity_m_s: f64,
    /// Deceleration of the quick-stop ramp (6085), m/s².
    pub quick_stop_deceleration_m_s2: f64,
    /// Following error window (6065), m.
    pub following_error_m: f64,
    /// How long the window may be exceeded (6066), ms.
    pub following_error_timeout_ms: u16,
    /// Gain of the position loop, 1/s.
    pub position_gain_per_s: f64,
    /// Gain of the velocity loop, N per m/s.
    pub velocity_gain_n_s_per_m: f64,
    /// Integral time of the velocity loop, s.
    pub velocity_integral_time_s: f64,
    /// One increment of the encoder, m.
    pub encoder_resolution_m: f64,
    /// Standard deviation of the encoder's noise, m.
    pub encoder_noise_m: f64,
}

impl DriveConfig {
    /// The encoder's increments nearest to so many metres; also of m/s and m/s².
    pub fn increments(&self, metres: f64) -> f64 {
        (metres / self.encoder_resolution_m).round()
    }
}

/// The drives of slides and of legs; what a table does not give stays as it is by default.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DrivesConfig {
    /// Drives of d₁ d₂ d₃.
    #[serde(deserialize_with = "slide")]
    pub slide: DriveConfig,
    /// Drives of l₁ l₂ l₃.
    #[serde(deserialize_with = "leg")]
    pub leg: DriveConfig,
}

impl DrivesConfig {
    /// The drive of an axis.
    pub const fn of_axis(&self, axis: usize) -> DriveConfig {
        if axis < LEGS { self.slide } else { self.leg }
    }
}

fn slide<'de, D: Deserializer<'de>>(table: D) -> Result<DriveConfig, D::Error> {
    over(DrivesConfig::default().slide, table)
}

fn leg<'de, D: Deserializer<'de>>(table: D) -> Result<DriveConfig, D::Error> {
    over(DrivesConfig::default().leg, table)
}

fn over<'de, D: Deserializer<'de>>(defaults: DriveConfig, given: D) -> Result<DriveConfig, D::Error> {
    let mut table = Table::try_from(defaults).map_err(Error::custom)?;
    table.extend(Table::deserialize(given)?);
    table.try_into().map_err(Error::custom)
}

impl Default for DrivesConfig {
    fn default() -> Self {
        let leg = DriveConfig {
            rated_force_n: 500.0,
            max_force_n: 1000.0,
            max_velocity_m_s: 0.4,
            quick_stop_deceleration_m_s2: 10.0,
            following_error_m: 0.002,
            following_error_timeout_ms: 20,
            position_gain_per_s: 100.0,
            velocity_gain_n_s_per_m: 600.0,
            velocity_integral_time_s: 0.01,
            encoder_resolution_m: 1e-6,
            encoder_noise_m: 0.2e-6,
        };
        let slide = DriveConfig {
            rated_force_n: 250.0,
            max_force_n: 500.0,
            max_velocity_m_s: 0.2,
            velocity_gain_n_s_per_m: 2000.0,
            ..leg
        };
        Self { slide, leg }
    }
}

/// The moving masses and their friction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DynamicsConfig {
    /// Integration step of the mechanism and of the drives' inner loops, ns; the more friction, the shorter.
    pub step_ns: u64,
    /// Carriage with the fixed part of its leg, moved by a slide, kg.
    pub carriage_mass_kg: f64,
    /// Telescoping part of a leg, kg.
    pub rod_mass_kg: f64,
    /// Inertia of a leg about its hinge, kg m².
    pub leg_inertia_kg_m2: f64,
    /// Platform with the lower jaw, kg.
    pub platform_mass_kg: f64,
    /// Principal inertia of the platform about its origin, platform axes, kg m².
    pub platform_inertia_kg_m2: [f64; 3],
    /// Coulomb friction of a slide, N; of a leg a quarter of it.
    pub slide_friction_n: f64,
    /// Viscous friction of every axis, N per m/s.
    pub viscous_friction_n_s_per_m: f64,
    /// Gravity along −z, m/s².
    pub gravity_m_s2: f64,
    /// Length of the legs when the rig is switched on, m.
    pub initial_leg_m: f64,
}

impl Default for DynamicsConfig {
    fn default() -> Self {
        Self {
            step_ns: 125_000,
            carriage_mass_kg: 1.2,
            rod_mass_kg: 0.4,
            leg_inertia_kg_m2: 0.03,
            platform_mass_kg: 0.5,
            platform_inertia_kg_m2: [2.0e-4, 2.0e-4, 3.5e-4],
            slide_friction_n: 8.0,
            viscous_friction_n_s_per_m: 20.0,
            gravity_m_s2: 9.81,
            initial_leg_m: 0.29,
        }
    }
}
