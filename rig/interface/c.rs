//! The C header of the messages.

use std::fmt::Write;

use masseter_runtime::messages::LAYOUT_VERSION;
use masseter_runtime::messages::codes::{NO_AXIS, NO_DRIVE_STATE};

use super::description::{Enumeration, Layout, LayoutField, constant, snake_case};

/// The header, for C11 and C++17.
pub(super) fn header(layouts: &[Layout], enumerations: &[Enumeration]) -> String {
    let mut text = format!(
        "/* The messages between the rig and a controller. Generated: masseter interface c\n \
         * Times are ns of CLOCK_MONOTONIC, 0 where nothing happened yet. Lengths are in m, poses in the base frame. */\n\
         #ifndef MASSETER_MESSAGES_H\n#define MASSETER_MESSAGES_H\n\n\
         #include <assert.h>\n#include <stddef.h>\n#include <stdint.h>\n\n\
         #define MASSETER_LAYOUT_VERSION {LAYOUT_VERSION}u\n\
         /* masseter_event.axis when no axis is concerned. */\n#define MASSETER_NO_AXIS {NO_AXIS}u\n\
         /* masseter_reading.drive_state of a drive not heard of yet, or lost. */\n\
         #define MASSETER_NO_DRIVE_STATE {NO_DRIVE_STATE}u\n"
    );
    for enumeration in enumerations {
        write_enumeration(&mut text, enumeration);
    }
    for layout in layouts {
        write_layout(&mut text, layout);
    }
    text + "\n#endif\n"
}

fn write_enumeration(text: &mut String, Enumeration { name, values }: &Enumeration) {
    let prefix = constant(&snake_case(name));
    let _ = write!(text, "\nenum masseter_{} {{\n", snake_case(name));
    for (value, number, about) in values {
        let _ = writeln!(text, "    /* {about} */\n    MASSETER_{prefix}_{} = {number},", constant(value));
    }
    text.push_str("};\n");
}

fn write_layout(text: &mut String, layout: &Layout) {
    let name = format!("masseter_{}", snake_case(layout.name));
    let prefix = constant(&name);
    let _ = write!(
        text,
        "\n#define {prefix}_TOPIC \"{}\"\n#define {prefix}_TYPE_NAME \"{}\"\n\n/* {} */\ntypedef struct {name} {{\n",
        layout.topic, layout.shared_memory_name, layout.about
    );
    for field in &layout.fields {
        let _ = writeln!(text, "    /* {} */\n    {};", field.about, declaration(field));
    }
    let _ =
        writeln!(text, "}} {name};\n\nstatic_assert(sizeof({name}) == {}, \"size of {name}\");", layout.size);
    for LayoutField { name: field, offset, .. } in &layout.fields {
        let _ =
            writeln!(text, "static_assert(offsetof({name}, {field}) == {offset}, \"offset of {field}\");");
    }
}

fn declaration(LayoutField { name, element, count, .. }: &LayoutField) -> String {
    let element = match element.as_str() {
        "float64" => "double".to_owned(),
        integer => format!("{integer}_t"),
    };
    count.map_or_else(|| format!("{element} {name}"), |count| format!("{element} {name}[{count}]"))
}
