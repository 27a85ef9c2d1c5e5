//! The ROS 2 message definition of a layout, from the field types of its table.

/// A type that a message field may have.
pub(super) trait FieldType {
    fn ros_type() -> String;
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

/// One `type name` line a field.
pub(super) fn definition<'a>(fields: impl Iterator<Item = (&'a str, String)>) -> String {
    fields.fold(String::new(), |text, (name, ros_type)| text + &ros_type + " " + name + "\n")
}

#[cfg(test)]
mod tests {
    use crate::messages::{Command, FrameTap, Message};

    #[test]
    fn the_schema_lists_every_field_in_order() {
        assert_eq!(
            FrameTap::schema(),
            "uint64 seq\nuint64 published_ns\nuint64 version\nuint64 time_ns\nuint64 queued_ns\n\
             uint32 id\nuint16 bus\nuint8 length\nuint8 flags\nuint8[64] data\n"
        );
        assert!(Command::schema().contains("float64[6] target_m\n"));
    }

    #[test]
    fn stamping_fills_the_header_only() {
        let mut command = Command { cycle: 7, ..Default::default() };
        command.stamp(3, 99);
        assert_eq!((command.seq, command.published_ns, command.cycle), (3, 99, 7));
        assert_eq!(command.version, crate::messages::LAYOUT_VERSION);
    }
}
