//! The kinds of faults, each with its layer, its keys, and its meaning.

use std::borrow::Cow;
use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

use crate::quantity::Dimension;

/// The declaration of a kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaultDeclaration {
    /// Its name in scenarios.
    pub name: &'static str,
    /// The name of its layer.
    pub layer: &'static str,
    /// The effect of several entries of this kind that are active at one place at one time.
    pub overlap: Overlap,
    /// The required keys, beside those of the time.
    pub needs: &'static [&'static str],
    /// The optional keys.
    pub takes: &'static [&'static str],
    /// Its size; none for a kind without a size.
    pub size: Option<FaultSize>,
    /// Its meaning.
    pub about: &'static str,
}

/// What acts where several entries of one kind are active at one place. An entry of all axes is one of each axis. Once an
/// entry ends, those that are left act alone. An entry counts as acting by what it changes itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Overlap {
    /// The sum: of the errors that the entries make of the true position, or of their sizes.
    Adds,
    /// The entry alone that began last; of those that begin together, the last of the list.
    Latest,
    /// The effect of one entry, from the first beginning to the last end.
    Once,
    /// Every entry by itself, in the order of the list.
    Each,
}

/// The size of a fault: its dimension, its range in SI units, and the size of a real fault as an example.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaultSize {
    /// Its dimension.
    pub dimension: Dimension,
    /// The smallest valid size.
    pub min: f64,
    /// The largest valid size.
    pub max: f64,
    /// A size that a real fault may have.
    pub example: &'static str,
    /// Its meaning, in words.
    pub about: &'static str,
}

/// Declares layers and kinds: name, overlap, required keys, optional keys, and the size of a kind with a size.
macro_rules! fault_kinds {
    ($($(#[doc = $part:literal])+ $layer:ident $layer_name:literal: $faults:ident {
        $($(#[doc = $doc:literal])+ $kind:ident $name:literal $overlap:ident [$($need:ident)*] $([$($take:ident)*])?
            $(, $dimension:ident $min:literal to $max:literal, $example:literal $about:literal)?;)*
    })*) => {
        /// The kind of a fault, by the part of the rig that it acts in.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum FaultKindConfig {
            $($(#[doc = $part])+ $layer($faults),)*
        }

        $(
            $(#[doc = $part])+
            #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
            pub enum $faults {
                $($(#[doc = $doc])+ $kind,)*
            }

            impl From<$faults> for FaultKindConfig {
                fn from(kind: $faults) -> Self {
                    Self::$layer(kind)
                }
            }
        )*

        impl FaultKindConfig {
            /// Every kind.
            pub const ALL: &'static [Self] = &[$($(Self::$layer($faults::$kind),)*)*];

            /// The names of all kinds.
            pub const NAMES: &'static [&'static str] = &[$($($name,)*)*];

            /// The declaration of the kind.
            pub const fn declared(self) -> &'static FaultDeclaration {
                match self {
                    $($(Self::$layer($faults::$kind) => const {
                        &FaultDeclaration {
                            name: $name,
                            layer: $layer_name,
                            overlap: Overlap::$overlap,
                            needs: &[$(stringify!($need),)* $(fault_kinds!(@key $dimension))?],
                            takes: &[$($(stringify!($take)),*)?],
                            size: fault_kinds!(@size $($dimension $min to $max, $example $about)?),
                            about: concat!($($doc),+).trim_ascii_start(),
                        }
                    },)*)*
                }
            }
        }
    };
    (@key $dimension:ident) => { "size" };
    (@size) => { None };
    (@size $dimension:ident $min:literal to $max:literal, $example:literal $about:literal) => {
        Some(FaultSize {
            dimension: Dimension::$dimension, min: $min, max: $max, example: $example, about: $about,
        })
    };
}

fault_kinds! {
    /// The frames of a bus, or a node on it.
    Bus "bus": BusFault {
        /// Frames are destroyed on the wire and repeated by their transmitter.
        Corrupt "corrupt" Each [bus] [node id probability count];
        /// A receiver loses frames without an error on the wire.
        Lose "lose" Each [bus] [node id probability count];
        /// Frames are held back before they are queued for transmission.
        Delay "delay" Each [bus] [node id probability count], Time 0.0 to 10.0, "1500 us" "how long";
        /// Frames arrive, and their transmitter repeats them.
        Duplicate "duplicate" Each [bus] [node id probability count];
        /// A node sends `data` (8 bytes of 55h unless given) with identifier `id` (001h unless given) whenever the bus
        /// is idle.
        Babble "babble" Each [bus node] [id data count];
        /// A node is disconnected.
        Disconnect "disconnect" Each [bus node];
        /// A node's controller goes off the bus.
        BusOff "bus_off" Each [bus node] [count];
    }
    /// What an encoder counts.
    Encoder "encoder": EncoderFault {
        /// The encoder repeats its last position: a broken disc or a hung interface.
        Stuck "encoder_stuck" Once [axis];
        /// The position jumps by a constant: a slipped coupling.
        Offset "encoder_offset" Adds [axis], Length -0.1 to 0.1, "1 mm" "the jump";
        /// The position drifts away at a constant speed: a coupling that slips.
        Drift "encoder_drift" Adds [axis], Velocity -1.0 to 1.0, "5 mm/s" "the speed";
        /// Gaussian noise on the position: bad shielding.
        Noise "encoder_noise" Adds [axis], Length 0.0 to 0.01, "50 um" "its standard deviation";
        /// The position has coarser steps: lost low bits.
        Steps "encoder_steps" Latest [axis], Length 1e-9 to 0.01, "0.1 mm" "the step";
        /// The position counts the other way from where it is: swapped tracks.
        Sign "encoder_sign" Once [axis];
        /// A share of every movement is not counted: dirt on the scale.
        Loses "encoder_loses" Adds [axis], One 0.0 to 1.0, "5 %" "the share that is lost";
        /// The position is an old one: a filter or a slow interface.
        Delay "encoder_delay" Adds [axis], Time 0.0 to 0.1, "5 ms" "how old";
    }
    /// A drive.
    Drive "drive": DriveFault {
        /// The drive goes into fault by itself, EMCY 5112h: its logic supply is too low.
        Fault "drive_fault" Once [axis];
        /// The drive acknowledges targets and does not follow them.
        IgnoresTargets "drive_ignores_targets" Once [axis];
        /// The motor gives less force than the drive asks for: demagnetised, or a phase lost.
        TorqueLoss "drive_torque_loss" Adds [axis], One 0.0 to 1.0, "50 %" "the share that is lost";
        /// The drive runs away at full current towards larger positions, whatever it is asked to do.
        Runaway "drive_runaway" Once [axis];
        /// Safe torque off: the motor has no current and the drive goes to "switch on disabled".
        Sto "drive_sto" Once [axis];
        /// "Operation enabled" comes late.
        SlowEnable "drive_slow_enable" Latest [axis], Time 0.0 to 60.0, "1 s" "how late";
        /// The brake never closes: without current the axis is free.
        BrakeOpen "brake_open" Once [axis];
        /// The brake does not open: the motor works against it.
        BrakeClosed "brake_closed" Once [axis];
        /// The supply dips: the drive is off for a while, then boots with its stored values.
        Reboot "drive_reboot" Once [axis], Time 0.0 to 10.0, "200 ms" "how long the drive is off";
        /// The drive moves by a wrong scale from where it is: a wrong gear ratio.
        Scale "drive_scale" Latest [axis], One 0.0 to 3.0, "1.05" "millimetres that it moves for each that it is asked to";
        /// The drive sends emergency messages again and again.
        EmcyStorm "emcy_storm" Latest [axis], Time 1e-4 to 1.0, "5 ms" "the time between two";
    }
    /// An axis of the emulated mechanism.
    Axis "mechanism": AxisFault {
        /// The axis jams: a guide seizes and holds it, up to 2 kN.
        Jam "jam" Once [axis];
        /// Friction grows: dry guides.
        Friction "friction" Latest [] [axis], One 0.0 to 100.0, "5" "the factor on the axis' friction";
        /// The joint has play between drive and platform.
        Play "play" Adds [axis], Length 0.0 to 0.02, "0.2 mm" "the play";
        /// The rod is broken: the axis moves freely, without force of the drive.
        BrokenRod "broken_rod" Once [axis];
        /// A hard stop stands in the axis' way, on both sides of where it is.
        EndStop "end_stop" Each [axis], Length 0.0 to 0.1, "1 mm" "the way left to either side";
    }
    /// The platform of the emulated mechanism.
    Platform "mechanism": PlatformFault {
        /// The platform carries more mass, at the incisal point.
        Payload "payload" Adds [], Mass 0.0 to 20.0, "0.5 kg" "the mass";
    }
    /// The commands of the controller.
    Command "command": CommandFault {
        /// The controller's commands stop coming, while it stands still: a stalled process.
        ControllerStall "controller_stall" Each [], Time 0.0 to 10.0, "50 ms" "how long";
        /// The targets of a command are no numbers.
        Nan "command_nan" Each [];
        /// One target jumps.
        Jump "command_jump" Each [axis], Length -0.1 to 0.1, "1 mm" "the jump";
        /// Commands carry another version of the layout.
        Version "command_version" Each [];
        /// Commands are those of another controller.
        Foreign "command_foreign" Each [];
    }
    /// A process of the rig, or the machine under it.
    Process "process": ProcessFault {
        /// The controller is killed.
        ControllerKill "controller_kill" Each [];
        /// The plant is stopped for a while, then goes on.
        PlantStall "plant_stall" Each [], Time 0.0 to 10.0, "50 ms" "how long";
        /// The plant is killed.
        PlantKill "plant_kill" Each [];
        /// The recorder is stopped for a while, then goes on.
        RecorderStall "recorder_stall" Each [], Time 0.0 to 10.0, "50 ms" "how long";
        /// The recorder is killed.
        RecorderKill "recorder_kill" Each [];
        /// Another task of higher priority takes the controller's core.
        CoreStall "core_stall" Each [], Time 0.0 to 1.0, "50 ms" "how long";
        /// The recording can grow no further.
        DiskFull "disk_full" Each [];
    }
}

impl FaultKindConfig {
    /// Its name in scenarios.
    pub const fn name(self) -> &'static str {
        self.declared().name
    }

    /// Whether the kind acts on a process: the supervisor then carries the fault out.
    pub const fn is_of_process(self) -> bool {
        matches!(self, Self::Process(_))
    }

    /// Whether a key has an effect on the kind.
    pub fn takes(self, key: &str) -> bool {
        let FaultDeclaration { needs, takes, .. } = self.declared();
        needs.contains(&key) || takes.contains(&key)
    }
}

impl Display for FaultKindConfig {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for FaultKindConfig {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for FaultKindConfig {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = Cow::<str>::deserialize(deserializer)?;
        let kind = Self::ALL.iter().find(|kind| kind.name() == name);
        kind.copied().ok_or_else(|| D::Error::unknown_variant(&name, Self::NAMES))
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
            assert!(kind.declared().about.ends_with('.'), "{kind}");
        }
    }

    #[test]
    fn the_rule_of_every_overlap_is_documented() {
        let text = include_str!("../../../../docs/faults.md");
        let (_, section) = text.split_once("\n## Overlaps\n").unwrap();
        for kind in FaultKindConfig::ALL {
            let FaultDeclaration { name, overlap, .. } = kind.declared();
            let rows: Vec<_> = section
                .lines()
                .filter(|line| line.starts_with('|') && line.contains(&format!("`{name}`")))
                .collect();
            let [row] = rows[..] else { panic!("{name}: {rows:?}") };
            assert!(row.starts_with(&format!("| {overlap:?} |")), "{row}");
        }
    }
}
