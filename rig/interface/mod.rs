//! `masseter interface`: the messages and codes between the rig and a controller in other languages, from the one table of
//! the messages. Frames and counters are not among them, since no controller uses them.

mod c;
mod description;
mod python;

use clap::{Args, ValueEnum};
use masseter_terminal::{Exit, result};

use description::{enumerations, layouts};

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
    /// Python module: ctypes, NumPy types, enumerations
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The copies that users include are those of this version.
    #[test]
    fn the_kept_copies_are_what_the_table_of_messages_gives() {
        let (layouts, enumerations) = (layouts(), enumerations());
        let header = include_str!("../../shared/interface/masseter_messages.h");
        let is_kept = header == c::header(&layouts, &enumerations);
        assert!(is_kept, "cargo run -- interface c > shared/interface/masseter_messages.h");
        let module = include_str!("../../shared/python/masseter/messages.py");
        let is_kept = module == python::module(&layouts, &enumerations);
        assert!(is_kept, "cargo run -- interface python > shared/python/masseter/messages.py");
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
