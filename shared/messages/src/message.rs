//! The common parts of messages: the macro that declares a message, the types of fields, and the ROS 2 definition. The
//! messages themselves are in the [parent module](super).

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;
use masseter_can::Frame;

use super::codes;

/// Version of the layouts of all messages. The version changes with any layout, and with the meaning of a field.
pub const LAYOUT_VERSION: u64 = 15;
/// Room for the data bytes of frames of other formats too.
const MOST_BYTES: usize = 64;
/// Most numbers in a message.
pub const MOST_VALUES: usize = 64;
/// The endings of names with their units. Of two that fit, the first counts.
const UNITS: [(&str, &str); 7] =
    [("_m_s", "m/s"), ("_ns", "ns"), ("_m", "m"), ("_s", "s"), ("_n", "N"), ("_rad", "rad"), ("_j", "J")];

/// The type of the messages of a topic.
pub trait Message: Pod + ZeroCopySend + Default + std::fmt::Debug + PartialEq {
    /// The topic of the message.
    const TOPIC: &'static str;
    /// Messages that a subscriber keeps; a slower subscriber loses the oldest messages.
    const DEPTH: usize;
    /// Type name in recordings.
    const TYPE_NAME: &'static str;
    /// Type name in shared memory, `masseter/Reading/<hash>`: the opening of a service with another layout fails. The
    /// hash covers the schema, the version, and the number and name of every code in messages.
    const SHARED_MEMORY_NAME: &'static str;
    /// [`LAYOUT_VERSION`] of the sender.
    fn version(&self) -> u64;
    /// Meaning of the message.
    fn about() -> &'static str;
    /// The fields in order.
    fn fields() -> Vec<Field>;
    /// The layout in the ROS 2 message definition language: one `type name` line a field.
    fn schema() -> String {
        let fields = Self::fields();
        fields.iter().fold(String::new(), |text, field| text + &field.ros_type + " " + field.name + "\n")
    }
    /// The layout with comments (meaning, units and the names of codes), for recordings.
    fn definition() -> String {
        let lines = Self::fields().iter().map(Field::line).collect::<String>();
        format!("# {}\n{lines}", plain(Self::about()))
    }
    /// The CDR body: all bytes except the unused ones at the end.
    fn body(&self) -> &[u8];
    /// The message with this body; none for an invalid body.
    fn from_body(body: &[u8]) -> Option<Self>;
    /// Stamps sequence number, time and version just before the transmission.
    fn stamp(&mut self, seq: u64, published_ns: u64);
}

macro_rules! messages {
    ($($(#[doc = $doc:literal])* $name:ident on $topic:literal keeping $depth:literal as $type_name:tt {
        $($(#[doc = $field_doc:literal])* $field:ident: $type:ty,)*
    })*) => {$(
        $(#[doc = $doc])*
        #[repr(C)]
        #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable, ZeroCopySend)]
        #[type_name($type_name)]
        pub struct $name {
            /// Number of this message on its topic, from 1.
            pub seq: u64,
            /// When it was published, ns.
            pub published_ns: u64,
            /// [`LAYOUT_VERSION`] of the sender.
            pub version: u64,
            $($(#[doc = $field_doc])* pub $field: $type,)*
        }

        impl serde::Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                self.body().serialize(serializer)
            }
        }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let body = Vec::<u8>::deserialize(deserializer)?;
                Self::from_body(&body).ok_or_else(|| serde::de::Error::custom("no body of this message"))
            }
        }

        impl Default for $name {
            /// All zeros.
            fn default() -> Self {
                Self::zeroed()
            }
        }

        impl Message for $name {
            const TOPIC: &'static str = $topic;
            const DEPTH: usize = $depth;
            const TYPE_NAME: &'static str = concat!("masseter/", stringify!($name));
            const SHARED_MEMORY_NAME: &'static str = $type_name;

            fn version(&self) -> u64 {
                self.version
            }

            fn about() -> &'static str {
                concat!($($doc),*)
            }

            fn fields() -> Vec<Field> {
                vec![
                    Field::new::<u64>("seq", offset_of!(Self, seq), " Number of this message on its topic, from 1."),
                    Field::new::<u64>("published_ns", offset_of!(Self, published_ns), " When it was published, ns."),
                    Field::new::<u64>("version", offset_of!(Self, version), " Version of the sender's layouts."),
                    $(Field::new::<$type>(
                        stringify!($field),
                        offset_of!(Self, $field),
                        concat!($($field_doc),*),
                    ),)*
                ]
            }

            fn body(&self) -> &[u8] {
                let unused = 0 $(+ self.$field.unused_bytes())*;
                &bytes_of(self)[..size_of::<Self>() - unused]
            }

            fn from_body(body: &[u8]) -> Option<Self> {
                let mut message = Self::default();
                bytes_of_mut(&mut message).get_mut(..body.len())?.copy_from_slice(body);
                (message.body().len() == body.len()).then_some(message)
            }

            fn stamp(&mut self, seq: u64, published_ns: u64) {
                (self.seq, self.published_ns, self.version) = (seq, published_ns, LAYOUT_VERSION);
            }
        }
    )*};
}
pub(crate) use messages;

/// A type of a message field.
pub(super) trait FieldType {
    fn ros_type() -> String;

    /// Unused bytes at the end of the field. Only a message's last field may have unused bytes.
    fn unused_bytes(&self) -> usize {
        0
    }
}

macro_rules! field_types {
    ($($rust:ty => $ros:literal),*) => {$(
        impl FieldType for $rust {
            fn ros_type() -> String {
                $ros.to_owned()
            }
        }
    )*};
}

field_types!(u8 => "uint8", u16 => "uint16", u32 => "uint32", u64 => "uint64", f64 => "float64");

impl<T: FieldType, const N: usize> FieldType for [T; N] {
    fn ros_type() -> String {
        format!("{}[{N}]", T::ros_type())
    }
}

/// A field of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Its name, which ends with the unit.
    pub name: &'static str,
    /// Its type in the ROS 2 message definition language.
    pub ros_type: String,
    /// Its offset in the message, bytes.
    pub offset: usize,
    /// Its meaning.
    pub about: &'static str,
}

impl Field {
    pub(super) fn new<T: FieldType>(name: &'static str, offset: usize, about: &'static str) -> Self {
        Self { name, ros_type: T::ros_type(), offset, about }
    }

    /// The unit of its values; empty for none.
    pub fn unit(&self) -> &'static str {
        UNITS.iter().find(|(ending, _)| self.name.ends_with(ending)).map_or("", |(_, unit)| unit)
    }

    /// Its meaning, without the links of Rust's documentation.
    pub fn meaning(&self) -> String {
        plain(self.about)
    }

    /// The numbers and names of its values, for an enumeration.
    pub fn codes(&self) -> Vec<(u32, &'static str)> {
        let Some((before, behind)) = self.about.split_once("[`codes::") else { return Vec::new() };
        let is_all_it_holds = [", a ", ", an ", ", "].iter().any(|words| before.ends_with(words));
        let name = behind.split('`').next().filter(|_| is_all_it_holds);
        name.map(codes::of_enumeration).unwrap_or_default()
    }

    /// Its line in a definition with comments: unit, meaning, and the names of its values.
    fn line(&self) -> String {
        let unit = if self.unit().is_empty() { String::new() } else { format!("[{}] ", self.unit()) };
        let codes: Vec<_> = self.codes().iter().map(|(code, name)| format!("{code} = {name}")).collect();
        let codes = if codes.is_empty() { String::new() } else { format!(" {}", codes.join(", ")) };
        format!("{} {}  # {unit}{}{codes}\n", self.ros_type, self.name, self.meaning())
    }
}

/// A comment without the links of Rust's documentation.
pub fn plain(about: &str) -> String {
    let text = about.replace("codes::", "").replace("super::", "");
    let text = text.replace("[`", "").replace("`]", "").replace('`', "");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Data bytes as a CDR sequence: the number, then the bytes. Unused bytes are zero.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable, ZeroCopySend)]
pub struct CanData {
    /// Number of bytes in use.
    pub length: u32,
    /// The bytes in use, then zeros.
    pub bytes: [u8; MOST_BYTES],
}

impl CanData {
    /// The data of a frame.
    ///
    /// # Panics
    /// With too many bytes.
    pub fn new(data: &[u8]) -> Self {
        let mut bytes = [0; MOST_BYTES];
        bytes[..data.len()].copy_from_slice(data);
        Self { length: data.len() as u32, bytes }
    }

    /// The data of a classic frame.
    pub fn of_frame(frame: &Frame) -> Self {
        let mut bytes = [0; MOST_BYTES];
        bytes[..Frame::MAX_DATA].copy_from_slice(frame.padded());
        Self { length: frame.data().len() as u32, bytes }
    }

    /// The data of a frame; none for too many bytes.
    pub fn checked(data: &[u8]) -> Option<Self> {
        (data.len() <= MOST_BYTES).then(|| Self::new(data))
    }

    /// The bytes in use.
    pub fn as_slice(&self) -> &[u8] {
        &self.bytes[..MOST_BYTES - self.unused_bytes()]
    }
}

impl FieldType for CanData {
    fn ros_type() -> String {
        format!("{}[<={MOST_BYTES}]", u8::ros_type())
    }

    fn unused_bytes(&self) -> usize {
        MOST_BYTES.saturating_sub(self.length as usize)
    }
}

/// Numbers as a CDR sequence: the count, then the numbers on their alignment. Unused numbers are zero.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable, ZeroCopySend)]
pub struct Values {
    /// Number of values in use.
    pub length: u32,
    /// The alignment of the first value.
    unused: u32,
    /// The values in use, then zeros.
    pub values: [f64; MOST_VALUES],
}

impl Values {
    /// This many zeros.
    ///
    /// # Panics
    /// With too many numbers.
    pub fn zeros(length: usize) -> Self {
        assert!(length <= MOST_VALUES, "{length} values have no room");
        Self { length: length as u32, ..Self::zeroed() }
    }

    /// The values in use.
    pub fn as_slice(&self) -> &[f64] {
        &self.values[..self.count()]
    }

    /// The values in use, mutable.
    pub fn as_mut_slice(&mut self) -> &mut [f64] {
        let count = self.count();
        &mut self.values[..count]
    }

    fn count(&self) -> usize {
        MOST_VALUES.min(self.length as usize)
    }
}

impl FieldType for Values {
    fn ros_type() -> String {
        format!("{}[<={MOST_VALUES}]", f64::ros_type())
    }

    fn unused_bytes(&self) -> usize {
        (MOST_VALUES - self.count()) * size_of::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Command, Event, FrameTap, Reading, State};

    #[test]
    fn the_schema_lists_every_field_in_order() {
        assert_eq!(
            FrameTap::schema(),
            "uint64 seq\nuint64 published_ns\nuint64 version\nuint64 time_ns\nuint64 queued_ns\n\
             uint32 id\nuint32 bus\nuint32 flags\nuint8[<=64] data\n"
        );
        assert!(Command::schema().contains("float64[6] target_m\n"));
    }

    #[test]
    fn the_comments_of_a_definition_tell_units_meanings_and_codes_and_change_no_field() {
        let commented = State::definition();
        assert!(
            commented.starts_with(
                "# The controller's state and its estimate, once a cycle. All float64 fields but "
            )
        );
        for line in [
            "float64[3] leg_angle_rad  # [rad] θ₁ θ₂ θ₃, rad.\n",
            "uint32 iterations  # Iterations of the forward kinematics.\n",
            "uint32 controller_state  # State of the controller, a ControllerState. 0 = wait_readings, 1 = enabling,",
        ] {
            assert!(commented.contains(line), "{line}: {commented}");
        }
        let bare = commented.lines().filter_map(|line| line.split("  # ").next());
        let bare = bare.filter(|line| !line.starts_with('#')).map(|line| line.to_owned() + "\n");
        assert_eq!(bare.collect::<String>(), State::schema());
    }

    #[test]
    fn only_a_field_that_holds_nothing_else_has_the_names_of_codes() {
        let with_codes = |fields: Vec<Field>| -> Vec<_> {
            fields.iter().filter(|field| !field.codes().is_empty()).map(|field| field.name).collect()
        };
        assert_eq!(with_codes(Event::fields()), ["source", "kind", "cause"]);
        assert_eq!(with_codes(Reading::fields()), ["drive_state"]);
        assert_eq!(with_codes(Command::fields()), ["request", "controller_state"]);
    }

    #[test]
    fn a_unit_in_the_name_of_a_field_is_that_of_its_meaning() {
        fn check<M: Message>() {
            for field in M::fields().iter().filter(|field| !field.unit().is_empty()) {
                let meaning = field.meaning();
                let words = meaning.split([' ', '.', ',', ';', ':']).collect::<Vec<_>>();
                assert!(words.contains(&field.unit()), "{} [{}]: {meaning}", field.name, field.unit());
            }
        }
        check::<Command>();
        check::<State>();
        check::<FrameTap>();
        check::<Event>();
    }

    #[test]
    fn a_body_holds_the_used_bytes_and_restores_the_message() {
        for length in [0, 1, 8, 64] {
            let data = CanData::new(&[0xA5; 64][..length]);
            let frame = FrameTap { seq: 7, data, ..Default::default() };
            assert_eq!(frame.body().len(), size_of::<FrameTap>() - 64 + length);
            assert_eq!(FrameTap::from_body(frame.body()), Some(frame));
        }
        let command = Command { cycle: 3, ..Default::default() };
        assert_eq!(command.body().len(), size_of::<Command>());
        assert_eq!(Command::from_body(command.body()), Some(command));
    }

    #[test]
    fn a_body_that_no_message_has_makes_none() {
        let frame = FrameTap { data: CanData::new(&[0; 8]), ..Default::default() };
        let bytes = bytemuck::bytes_of(&frame);
        for cut in (0..frame.body().len()).chain(frame.body().len() + 1..=bytes.len()) {
            assert_eq!(FrameTap::from_body(&bytes[..cut]), None, "{cut} bytes");
        }
        assert_eq!(Command::from_body(&[0; size_of::<Command>() + 1]), None);
        assert_eq!(Command::from_body(&[0; size_of::<Command>() - 1]), None);
    }

    #[test]
    fn stamping_fills_the_header_only() {
        let mut command = Command { cycle: 7, ..Default::default() };
        command.stamp(3, 99);
        assert_eq!((command.seq, command.published_ns, command.cycle), (3, 99, 7));
        assert_eq!(command.version, LAYOUT_VERSION);
    }
}
