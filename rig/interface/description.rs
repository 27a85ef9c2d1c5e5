//! The messages and codes as other languages need them.

use masseter_runtime::messages::codes::{
    Cause, ControllerState, DriveRequest, DriveState, EventKind, NoPose, Source,
};
use masseter_runtime::messages::{Command, Contact, Event, Field, Message, Reading, State, Truth, plain};

/// A message as other languages need it.
pub(super) struct Layout {
    /// In camel case.
    pub(super) name: &'static str,
    pub(super) topic: &'static str,
    pub(super) shared_memory_name: &'static str,
    pub(super) about: &'static str,
    pub(super) size: usize,
    pub(super) fields: Vec<LayoutField>,
}

pub(super) struct LayoutField {
    pub(super) name: &'static str,
    /// `uint32`, `uint64` or `float64`, and so on.
    pub(super) element: String,
    /// None for a single value.
    pub(super) count: Option<usize>,
    pub(super) offset: usize,
    pub(super) about: String,
}

pub(super) struct Enumeration {
    /// In camel case.
    pub(super) name: &'static str,
    /// Name, number and meaning.
    pub(super) values: Vec<(&'static str, u32, String)>,
}

pub(super) fn layouts() -> Vec<Layout> {
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

pub(super) fn enumerations() -> Vec<Enumeration> {
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
pub(super) fn snake_case(name: &str) -> String {
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
pub(super) fn constant(name: &str) -> String {
    name.to_uppercase().replace([' ', '-'], "_")
}
