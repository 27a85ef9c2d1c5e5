//! The fields of a message, and their ROS 2 message definition, from the table of the layouts.

use super::codes;

/// A type that a message field may have.
pub(super) trait FieldType {
    fn ros_type() -> String;

    /// Unused bytes at the end of the field. Only a message's last field may have any.
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

/// The endings of names that tell a unit; of two that fit, the first counts.
const UNITS: [(&str, &str); 6] =
    [("_m_s", "m/s"), ("_ns", "ns"), ("_m", "m"), ("_s", "s"), ("_n", "N"), ("_rad", "rad")];

/// A field of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Its name, which ends with the unit.
    pub name: &'static str,
    /// Its type in the ROS 2 message definition language.
    pub ros_type: String,
    /// Where it begins in the message, bytes.
    pub offset: usize,
    /// What it is.
    pub about: &'static str,
}

impl Field {
    pub(super) fn new<T: FieldType>(name: &'static str, offset: usize, about: &'static str) -> Self {
        Self { name, ros_type: T::ros_type(), offset, about }
    }

    /// The unit of its values; empty where they have none.
    pub fn unit(&self) -> &'static str {
        UNITS.iter().find(|(ending, _)| self.name.ends_with(ending)).map_or("", |(_, unit)| unit)
    }

    /// What it is, without the links of Rust's documentation.
    pub fn meaning(&self) -> String {
        plain(self.about)
    }

    /// The numbers and names of its values, where it is an enumeration.
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

/// One `type name` line a field.
pub(super) fn definition(fields: &[Field]) -> String {
    fields.iter().fold(String::new(), |text, field| text + &field.ros_type + " " + field.name + "\n")
}

/// The same with comments, below one that says what the message is.
pub(super) fn commented(about: &str, fields: &[Field]) -> String {
    let lines = fields.iter().map(Field::line);
    lines.fold(format!("# {}\n", plain(about)), |text, line| text + &line)
}

#[cfg(test)]
mod tests {
    use super::Field;
    use crate::messages::{CanData, Command, Event, FrameTap, Message, Reading, State};

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
        assert_eq!(command.version, crate::messages::LAYOUT_VERSION);
    }
}
