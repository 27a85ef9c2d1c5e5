//! `masseter interface`: the messages and codes between the rig and a controller in other languages, from the one table of
//! the messages. Frames and counters are not among them, since no controller uses them.

mod c;
mod python;

use std::mem::size_of;

use clap::{Args, ValueEnum};
use masseter_shared::messages::codes::{
    Cause, ControllerState, DriveRequest, DriveState, EventKind, NoPose, Source,
};
use masseter_shared::messages::{Command, Event, Field, Message, Reading, State, Truth};
use masseter_terminal::{Exit, result};

/// The arguments of `interface`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter interface c > masseter_messages.h")]
pub(crate) struct InterfaceArgs {
    /// Language
    #[arg(value_enum)]
    language: Language,
}

/// A language with generated types.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Language {
    /// C header, for C++ too
    C,
    /// Python module: ctypes, `NumPy` types, enumerations
    Python,
}

/// Prints the types.
pub(crate) fn interface(args: &InterfaceArgs) -> anyhow::Result<Exit> {
    let (layouts, enumerations) = (layouts(), enumerations());
    let text = match args.language {
        Language::C => c::header(&layouts, &enumerations),
        Language::Python => python::module(&layouts, &enumerations),
    };
    result(&text)?;
    Ok(Exit::Passed)
}

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
    vec![layout::<Reading>(), layout::<Command>(), layout::<State>(), layout::<Event>(), layout::<Truth>()]
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

fn layout_field(Field { name, ros_type, offset, about }: Field) -> LayoutField {
    let (element, count) = match ros_type.split_once('[') {
        Some((element, count)) => (element.to_owned(), count.trim_end_matches(']').parse().ok()),
        None => (ros_type, None),
    };
    LayoutField { name, element, count, offset, about: plain(about) }
}

/// A comment without the links of Rust's documentation.
fn plain(about: &str) -> String {
    let text = about.replace("codes::", "").replace("super::", "");
    let text = text.replace("[`", "").replace("`]", "").replace('`', "");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The copies that users include are those of this version.
    #[test]
    fn the_kept_copies_are_what_the_table_of_messages_gives() {
        let (layouts, enumerations) = (layouts(), enumerations());
        for (kept, language, made) in [
            (
                include_str!("../../shared/interface/masseter_messages.h"),
                "c",
                c::header(&layouts, &enumerations),
            ),
            (
                include_str!("../../shared/interface/masseter_messages.py"),
                "python",
                python::module(&layouts, &enumerations),
            ),
        ] {
            let extension = if language == "c" { "h" } else { "py" };
            assert!(
                kept == made,
                "cargo run -- interface {language} > shared/interface/masseter_messages.{extension}"
            );
        }
    }

    #[test]
    fn every_field_has_a_meaning_and_the_fields_fill_the_message() {
        for layout in layouts() {
            let mut end = 0;
            for field in &layout.fields {
                assert!(
                    !field.about.is_empty() && !field.about.contains('['),
                    "{}: {}",
                    field.name,
                    field.about
                );
                assert_eq!(field.offset, end, "{}.{}", layout.name, field.name);
                let bytes =
                    field.element.trim_start_matches(char::is_alphabetic).parse::<usize>().unwrap() / 8;
                end += bytes * field.count.unwrap_or(1);
            }
            assert_eq!(end, layout.size, "{}", layout.name);
        }
    }
}
