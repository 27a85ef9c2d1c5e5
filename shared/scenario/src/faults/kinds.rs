//! The kinds of faults: the layer that they act in, the keys that they take, and what they stand for.

use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

use crate::quantity::Dimension;

/// The part of the rig that a fault acts in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum FaultLayer {
    /// The frames of a bus, or a node on it.
    Bus,
    /// What an encoder counts.
    Encoder,
    /// A drive.
    Drive,
    /// The emulated mechanism.
    Mechanism,
    /// The commands of the controller.
    Command,
    /// A process of the rig, or the machine under it.
    Process,
}

impl FaultLayer {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bus => "bus",
            Self::Encoder => "encoder",
            Self::Drive => "drive",
            Self::Mechanism => "mechanism",
            Self::Command => "command",
            Self::Process => "process",
        }
    }
}

/// What a fault acts on, and with that the keys that say where.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultPlace {
    /// Frames of a bus: `bus`, and where wanted `node`, `id`, `probability`, `count`.
    Frames,
    /// A node of a bus: `bus`, `node`.
    Node,
    /// An axis: `axis`.
    Axis,
    /// All axes, or one: `axis` where wanted.
    Axes,
    /// A fixed place.
    Fixed,
}

/// The size of a fault: what it measures, its range in SI units, and its value by default.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaultSize {
    /// What it measures.
    pub dimension: Dimension,
    /// The smallest valid size.
    pub min: f64,
    /// The largest valid size.
    pub max: f64,
    /// What it is, in words.
    pub about: &'static str,
}

macro_rules! fault_kinds {
    ($($(#[doc = $doc:literal])+ $kind:ident $name:literal: $layer:ident, $place:ident
        $(, $dimension:ident $min:literal to $max:literal $about:literal)?;)*) => {
        /// The kind of a fault.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum FaultKindConfig {
            $($(#[doc = $doc])+ $kind,)*
        }

        impl FaultKindConfig {
            /// Every kind.
            pub const ALL: &'static [Self] = &[$(Self::$kind),*];

            /// Its name in scenarios.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$kind => $name),* }
            }

            /// The layer that it acts in.
            pub const fn layer(self) -> FaultLayer {
                match self { $(Self::$kind => FaultLayer::$layer),* }
            }

            /// What it acts on.
            pub const fn place(self) -> FaultPlace {
                match self { $(Self::$kind => FaultPlace::$place),* }
            }

            /// Its size; none where it has no size.
            pub const fn size(self) -> Option<FaultSize> {
                match self {
                    $(Self::$kind => fault_kinds!(@size $($dimension $min to $max $about)?),)*
                }
            }

            /// What it stands for.
            pub const fn about(self) -> &'static str {
                match self { $(Self::$kind => concat!($($doc),+).trim_ascii_start()),* }
            }
        }
    };
    (@size) => { None };
    (@size $dimension:ident $min:literal to $max:literal $about:literal) => {
        Some(FaultSize { dimension: Dimension::$dimension, min: $min, max: $max, about: $about })
    };
}

fault_kinds! {
    /// Frames are destroyed on the wire and repeated by their transmitter.
    Corrupt "corrupt": Bus, Frames;
    /// A receiver loses frames without an error on the wire.
    Lose "lose": Bus, Frames;
    /// Frames are held back before they are queued for transmission.
    Delay "delay": Bus, Frames, Time 0.0 to 10.0 "how long";
    /// Frames arrive, and their transmitter repeats them.
    Duplicate "duplicate": Bus, Frames;
    /// A node sends `data` (8 bytes of 55h unless given) with identifier `id` (001h unless given) whenever the bus is idle.
    Babble "babble": Bus, Node;
    /// A node is disconnected.
    Disconnect "disconnect": Bus, Node;
    /// A node's controller goes off the bus.
    BusOff "bus_off": Bus, Node;

    /// The encoder repeats its last position: a broken disc or a hung interface.
    EncoderStuck "encoder_stuck": Encoder, Axis;
    /// The position jumps by a constant: a slipped coupling.
    EncoderOffset "encoder_offset": Encoder, Axis, Length -0.1 to 0.1 "the jump";
    /// The position drifts away at a constant speed: a coupling that slips.
    EncoderDrift "encoder_drift": Encoder, Axis, Velocity -1.0 to 1.0 "the speed";
    /// Gaussian noise on the position: bad shielding.
    EncoderNoise "encoder_noise": Encoder, Axis, Length 0.0 to 0.01 "its standard deviation";
    /// The position has coarser steps: lost low bits.
    EncoderSteps "encoder_steps": Encoder, Axis, Length 1e-9 to 0.01 "the step";
    /// The position counts the other way from where it is: swapped tracks.
    EncoderSign "encoder_sign": Encoder, Axis;
    /// A share of every movement is not counted: dirt on the scale.
    EncoderLoses "encoder_loses": Encoder, Axis, One 0.0 to 1.0 "the share that is lost";
    /// The position is an old one: a filter or a slow interface.
    EncoderDelay "encoder_delay": Encoder, Axis, Time 0.0 to 0.1 "how old";

    /// The drive goes into fault by itself, EMCY 5112h: its logic supply is too low.
    DriveFault "drive_fault": Drive, Axis;
    /// The drive acknowledges targets and does not follow them.
    DriveIgnoresTargets "drive_ignores_targets": Drive, Axis;
    /// The motor gives less force than the drive asks for: demagnetised, or a phase lost.
    DriveTorqueLoss "drive_torque_loss": Drive, Axis, One 0.0 to 1.0 "the share that is lost";
    /// The drive runs away at full current towards larger positions, whatever it is asked to do.
    DriveRunaway "drive_runaway": Drive, Axis;
    /// Safe torque off: the motor has no current and the drive goes to "switch on disabled".
    DriveSto "drive_sto": Drive, Axis;
    /// "Operation enabled" comes late.
    DriveSlowEnable "drive_slow_enable": Drive, Axis, Time 0.0 to 60.0 "how late";
    /// The brake never closes: without current the axis is free.
    BrakeOpen "brake_open": Drive, Axis;
    /// The brake does not open: the motor works against it.
    BrakeClosed "brake_closed": Drive, Axis;
    /// The supply dips: the drive is off for a while, then boots with its stored values.
    DriveReboot "drive_reboot": Drive, Axis, Time 0.0 to 10.0 "how long the drive is off";
    /// The drive moves by a wrong scale from where it is: a wrong gear ratio.
    DriveScale "drive_scale": Drive, Axis, One 0.0 to 3.0 "millimetres that it moves for each that it is asked to";
    /// The drive sends emergency messages again and again.
    EmcyStorm "emcy_storm": Drive, Axis, Time 1e-4 to 1.0 "the time between two";

    /// The axis jams: a guide seizes and holds it, up to 2 kN.
    Jam "jam": Mechanism, Axis;
    /// Friction grows: dry guides.
    Friction "friction": Mechanism, Axes, One 0.0 to 100.0 "the factor on the axis' friction";
    /// The platform carries more mass, at the incisal point.
    Payload "payload": Mechanism, Fixed, Mass 0.0 to 20.0 "the mass";
    /// The joint has play between drive and platform.
    Play "play": Mechanism, Axis, Length 0.0 to 0.02 "the play";
    /// The rod is broken: the axis moves freely, without force of the drive.
    BrokenRod "broken_rod": Mechanism, Axis;
    /// A hard stop stands in the axis' way, on both sides of where it is.
    EndStop "end_stop": Mechanism, Axis, Length 0.0 to 0.1 "the way left to either side";

    /// The controller's commands stop coming, while it stands still: a stalled process.
    ControllerStall "controller_stall": Command, Fixed, Time 0.0 to 10.0 "how long";
    /// The targets of a command are no numbers.
    CommandNan "command_nan": Command, Fixed;
    /// One target jumps.
    CommandJump "command_jump": Command, Axis, Length -0.1 to 0.1 "the jump";
    /// Commands carry another version of the layout.
    CommandVersion "command_version": Command, Fixed;
    /// Commands are those of another controller.
    CommandForeign "command_foreign": Command, Fixed;

    /// The controller is killed.
    ControllerKill "controller_kill": Process, Fixed;
    /// The plant is stopped for a while, then goes on.
    PlantStall "plant_stall": Process, Fixed, Time 0.0 to 10.0 "how long";
    /// The plant is killed.
    PlantKill "plant_kill": Process, Fixed;
    /// The recorder is stopped for a while, then goes on.
    RecorderStall "recorder_stall": Process, Fixed, Time 0.0 to 10.0 "how long";
    /// The recorder is killed.
    RecorderKill "recorder_kill": Process, Fixed;
    /// Another task of higher priority takes the controller's core.
    CoreStall "core_stall": Process, Fixed, Time 0.0 to 1.0 "how long";
    /// The recording can grow no further.
    DiskFull "disk_full": Process, Fixed;
}

impl Display for FaultKindConfig {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_that_scenarios_use() {
        for kind in FaultKindConfig::ALL {
            let read: FaultKindConfig = serde_json::from_str(&format!("\"{}\"", kind.name())).unwrap();
            assert_eq!(read, *kind);
            assert!(kind.about().ends_with('.'), "{kind}");
        }
    }
}
