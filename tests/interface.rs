//! The messages and codes between the rig and a controller in C and Python, made from the one table of the messages: the
//! files that users include, and that `masseter interface` prints. Frames and counters are not among them, since no
//! controller uses them.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use masseter_runtime::messages::codes::{
    Cause, ControllerState, DriveRequest, DriveState, EventKind, NO_AXIS, NO_DRIVE_STATE, NoPose, Source,
};
use masseter_runtime::messages::{
    Command, Contact, Event, Field, LAYOUT_VERSION, Message, Reading, State, Truth, plain,
};

use crate::common::{masseter, stdout};

/// A machine that lays structures out otherwise cannot use them.
const PYTHON_CHECK: &str = r#"

def _check(layout: type[ctypes.Structure], size: int, offsets: list[int]) -> None:
    found = [getattr(layout, field[0]).offset for field in layout._fields_]
    if ctypes.sizeof(layout) != size or found != offsets:
        raise ImportError(f"{layout.__name__} has another layout on this machine: {found}, expected {offsets}")
"#;

/// A message as other languages need it.
struct Layout {
    /// In camel case.
    name: &'static str,
    topic: &'static str,
    shared_memory_name: &'static str,
    about: &'static str,
    size: usize,
    fields: Vec<LayoutField>,
}

struct LayoutField {
    name: &'static str,
    /// `uint32`, `uint64` or `float64`, and so on.
    element: String,
    /// None for a single value.
    count: Option<usize>,
    offset: usize,
    about: String,
}

struct Enumeration {
    /// In camel case.
    name: &'static str,
    /// Name, number and meaning.
    values: Vec<(&'static str, u32, String)>,
}

fn layouts() -> Vec<Layout> {
    vec![
        layout::<Reading>(),
        layout::<Command>(),
        layout::<State>(),
        layout::<Event>(),
        layout::<Truth>(),
        layout::<Contact>(),
    ]
}

fn layout<M: Message>() -> Layout {
    Layout {
        name: M::TYPE_NAME.trim_start_matches("masseter/"),
        topic: M::TOPIC,
        shared_memory_name: M::SHARED_MEMORY_NAME,
        about: M::about().trim(),
        size: size_of::<M>(),
        fields: M::fields().into_iter().map(layout_field).collect(),
    }
}

fn layout_field(field: Field) -> LayoutField {
    let about = field.meaning();
    let Field { name, ros_type, offset, .. } = field;
    let (element, count) = match ros_type.split_once('[') {
        Some((element, count)) => (element.to_owned(), count.trim_end_matches(']').parse().ok()),
        None => (ros_type, None),
    };
    LayoutField { name, element, count, offset, about }
}

fn enumerations() -> Vec<Enumeration> {
    macro_rules! enumerations {
        ($($name:ident),*) => {
            vec![$(Enumeration {
                name: stringify!($name),
                values: $name::ALL.map(|value| (value.name(), u32::from(value.code()), plain(value.about()))).to_vec(),
            }),*]
        };
    }
    enumerations!(DriveRequest, DriveState, ControllerState, Source, EventKind, Cause, NoPose)
}

/// `DriveState` as `drive_state`.
fn snake_case(name: &str) -> String {
    let mut text = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !text.is_empty() {
            text.push('_');
        }
        text.extend(letter.to_lowercase());
    }
    text
}

/// A name of a value as a constant.
fn constant(name: &str) -> String {
    name.to_uppercase().replace([' ', '-'], "_")
}

/// The C header, for C11 and C++17.
fn c_header(layouts: &[Layout], enumerations: &[Enumeration]) -> String {
    let mut text = format!(
        "/* The messages between the rig and a controller. Generated: masseter interface c\n \
         * Times are ns of CLOCK_MONOTONIC, 0 where nothing happened yet. \
         Lengths are in m, poses in the base frame. */\n\
         #ifndef MASSETER_MESSAGES_H\n#define MASSETER_MESSAGES_H\n\n\
         #include <assert.h>\n#include <stddef.h>\n#include <stdint.h>\n\n\
         #define MASSETER_LAYOUT_VERSION {LAYOUT_VERSION}u\n\
         /* masseter_event.axis when no axis is concerned. */\n#define MASSETER_NO_AXIS {NO_AXIS}u\n\
         /* masseter_reading.drive_state of a drive not heard of yet, or lost. */\n\
         #define MASSETER_NO_DRIVE_STATE {NO_DRIVE_STATE}u\n"
    );
    for enumeration in enumerations {
        write_c_enumeration(&mut text, enumeration);
    }
    for layout in layouts {
        write_c_layout(&mut text, layout);
    }
    text + "\n#endif\n"
}

fn write_c_enumeration(text: &mut String, Enumeration { name, values }: &Enumeration) {
    let prefix = constant(&snake_case(name));
    let _ = write!(text, "\nenum masseter_{} {{\n", snake_case(name));
    for (value, number, about) in values {
        let _ = writeln!(text, "    /* {about} */\n    MASSETER_{prefix}_{} = {number},", constant(value));
    }
    text.push_str("};\n");
}

fn write_c_layout(text: &mut String, layout: &Layout) {
    let name = format!("masseter_{}", snake_case(layout.name));
    let prefix = constant(&name);
    let _ = write!(
        text,
        "\n#define {prefix}_TOPIC \"{}\"\n#define {prefix}_TYPE_NAME \"{}\"\n\n/* {} */\ntypedef struct {name} {{\n",
        layout.topic, layout.shared_memory_name, layout.about
    );
    for field in &layout.fields {
        let _ = writeln!(text, "    /* {} */\n    {};", field.about, c_declaration(field));
    }
    let _ =
        writeln!(text, "}} {name};\n\nstatic_assert(sizeof({name}) == {}, \"size of {name}\");", layout.size);
    for LayoutField { name: field, offset, .. } in &layout.fields {
        let _ =
            writeln!(text, "static_assert(offsetof({name}, {field}) == {offset}, \"offset of {field}\");");
    }
}

fn c_declaration(LayoutField { name, element, count, .. }: &LayoutField) -> String {
    let element = match element.as_str() {
        "float64" => "double".to_owned(),
        integer => format!("{integer}_t"),
    };
    count.map_or_else(|| format!("{element} {name}"), |count| format!("{element} {name}[{count}]"))
}

/// The Python module: structures as iceoryx2's binding takes them, with equal `NumPy` types.
fn python_module(layouts: &[Layout], enumerations: &[Enumeration]) -> String {
    let mut text = format!(
        "\"\"\"The messages between the rig and a controller. Generated: masseter interface python\n\n\
         Times are ns of CLOCK_MONOTONIC, 0 where nothing happened yet. Lengths are in m, poses in the base frame.\n\
         numpy.dtype(Reading) is the NumPy type of a message.\n\"\"\"\n\n\
         import ctypes\nimport enum\n\n\
         LAYOUT_VERSION = {LAYOUT_VERSION}\n\
         #: Event.axis when no axis is concerned.\nNO_AXIS = {NO_AXIS}\n\
         #: Reading.drive_state of a drive not heard of yet, or lost.\nNO_DRIVE_STATE = {NO_DRIVE_STATE}\n"
    );
    text.push_str(PYTHON_CHECK);
    for enumeration in enumerations {
        write_python_enumeration(&mut text, enumeration);
    }
    for layout in layouts {
        write_python_layout(&mut text, layout);
    }
    text
}

fn write_python_enumeration(text: &mut String, Enumeration { name, values }: &Enumeration) {
    let _ = write!(text, "\n\nclass {name}(enum.IntEnum):\n");
    for (value, number, about) in values {
        let _ = writeln!(text, "    #: {about}\n    {} = {number}", constant(value));
    }
}

fn write_python_layout(text: &mut String, layout: &Layout) {
    let Layout { name, topic, shared_memory_name, about, size, fields } = layout;
    let _ = write!(
        text,
        "\n\nclass {name}(ctypes.Structure):\n    \"\"\"{about}\"\"\"\n\n    TOPIC = \"{topic}\"\n    _fields_ = [\n"
    );
    for field in fields {
        let _ = writeln!(
            text,
            "        # {}\n        (\"{}\", {}),",
            field.about,
            field.name,
            python_ctype(field)
        );
    }
    let offsets: Vec<_> = fields.iter().map(|field| field.offset.to_string()).collect();
    let _ = write!(
        text,
        "    ]\n\n    @staticmethod\n    def type_name() -> str:\n        return \"{shared_memory_name}\"\n\n\n\
         _check({name}, {size}, [{}])\n",
        offsets.join(", ")
    );
}

fn python_ctype(LayoutField { element, count, .. }: &LayoutField) -> String {
    let element = match element.as_str() {
        "float64" => "ctypes.c_double".to_owned(),
        integer => format!("ctypes.c_{integer}"),
    };
    count.map_or_else(|| element.clone(), |count| format!("{element} * {count}"))
}

/// With RENEW_INTERFACE=1, the files are written instead.
#[test]
fn the_files_that_users_include_are_what_the_table_of_messages_gives() {
    let (layouts, enumerations) = (layouts(), enumerations());
    for (language, file, text) in [
        ("c", "rig/bindings/interface/masseter_messages.h", c_header(&layouts, &enumerations)),
        ("python", "rig/bindings/python/masseter/messages.py", python_module(&layouts, &enumerations)),
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
        if std::env::var_os("RENEW_INTERFACE").is_some() {
            fs::write(path, text).unwrap();
            continue;
        }
        let is_made = fs::read_to_string(path).unwrap() == text;
        assert!(is_made, "{file} is old: RENEW_INTERFACE=1 cargo test --test rig interface");
        assert!(stdout(&masseter(&["interface", language])) == text, "{language}: another file is printed");
    }
}

#[test]
fn every_field_has_a_meaning_and_the_fields_fill_the_message() {
    for layout in layouts() {
        let mut end = 0;
        for field in &layout.fields {
            assert!(!field.about.is_empty() && !field.about.contains('['), "{}: {}", field.name, field.about);
            assert_eq!(field.offset, end, "{}.{}", layout.name, field.name);
            let bytes = field.element.trim_start_matches(char::is_alphabetic).parse::<usize>().unwrap() / 8;
            end += bytes * field.count.unwrap_or(1);
        }
        assert_eq!(end, layout.size, "{}", layout.name);
    }
}
