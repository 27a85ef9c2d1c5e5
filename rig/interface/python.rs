//! The Python module of the messages.

use std::fmt::Write;

use masseter_runtime::messages::LAYOUT_VERSION;
use masseter_runtime::messages::codes::{NO_AXIS, NO_DRIVE_STATE};

use super::description::{Enumeration, Layout, LayoutField, constant};

/// A machine that lays structures out otherwise cannot use them.
const CHECK: &str = r#"

def _check(layout: type[ctypes.Structure], size: int, offsets: list[int]) -> None:
    found = [getattr(layout, field[0]).offset for field in layout._fields_]
    if ctypes.sizeof(layout) != size or found != offsets:
        raise ImportError(f"{layout.__name__} has another layout on this machine: {found}, expected {offsets}")
"#;

/// The module: structures as iceoryx2's binding takes them, with equal `NumPy` types.
pub(super) fn module(layouts: &[Layout], enumerations: &[Enumeration]) -> String {
    let mut text = format!(
        "\"\"\"The messages between the rig and a controller. Generated: masseter interface python\n\n\
         Times are ns of CLOCK_MONOTONIC, 0 where nothing happened yet. Lengths are in m, poses in the base frame.\n\
         numpy.dtype(Reading) is the NumPy type of a message.\n\"\"\"\n\n\
         import ctypes\nimport enum\n\n\
         LAYOUT_VERSION = {LAYOUT_VERSION}\n\
         #: Event.axis when no axis is concerned.\nNO_AXIS = {NO_AXIS}\n\
         #: Reading.drive_state of a drive not heard of yet, or lost.\nNO_DRIVE_STATE = {NO_DRIVE_STATE}\n"
    );
    text.push_str(CHECK);
    for enumeration in enumerations {
        write_enumeration(&mut text, enumeration);
    }
    for layout in layouts {
        write_layout(&mut text, layout);
    }
    text
}

fn write_enumeration(text: &mut String, Enumeration { name, values }: &Enumeration) {
    let _ = write!(text, "\n\nclass {name}(enum.IntEnum):\n");
    for (value, number, about) in values {
        let _ = writeln!(text, "    #: {about}\n    {} = {number}", constant(value));
    }
}

fn write_layout(text: &mut String, layout: &Layout) {
    let Layout { name, topic, shared_memory_name, about, size, fields } = layout;
    let _ = write!(
        text,
        "\n\nclass {name}(ctypes.Structure):\n    \"\"\"{about}\"\"\"\n\n    TOPIC = \"{topic}\"\n    _fields_ = [\n"
    );
    for field in fields {
        let _ = writeln!(text, "        # {}\n        (\"{}\", {}),", field.about, field.name, ctype(field));
    }
    let offsets: Vec<_> = fields.iter().map(|field| field.offset.to_string()).collect();
    let _ = write!(
        text,
        "    ]\n\n    @staticmethod\n    def type_name() -> str:\n        return \"{shared_memory_name}\"\n\n\n\
         _check({name}, {size}, [{}])\n",
        offsets.join(", ")
    );
}

fn ctype(LayoutField { element, count, .. }: &LayoutField) -> String {
    let element = match element.as_str() {
        "float64" => "ctypes.c_double".to_owned(),
        integer => format!("ctypes.c_{integer}"),
    };
    count.map_or_else(|| element.clone(), |count| format!("{element} * {count}"))
}
