//! The fields of a message, and their ROS 2 message definition, from the table of the layouts.

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
}

/// One `type name` line a field.
pub(super) fn definition(fields: &[Field]) -> String {
    fields.iter().fold(String::new(), |text, field| text + &field.ros_type + " " + field.name + "\n")
}

#[cfg(test)]
mod tests {
    use crate::messages::{CanData, Command, FrameTap, Message};

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
