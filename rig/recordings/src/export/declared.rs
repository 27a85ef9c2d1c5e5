//! The signals and parameters that the controller of a recorded run declared, from the definitions of their messages.

use masseter_recording::{Columns, Description, Topic};
use masseter_runtime::named::{Declared, Parameter, Signal};
use mcap::Channel;

/// What was declared. The values of the parameters at the start, and their ranges, are not known.
pub(super) fn declared<'a>(channels: impl Iterator<Item = &'a Channel<'static>>) -> Declared {
    let mut declared = Declared::default();
    for channel in channels {
        let found = named(channel);
        match Topic::named(&channel.topic) {
            Some(Topic::Signals) => declared.signals.extend(found),
            Some(Topic::Parameters) => declared.parameters.extend(found.map(parameter)),
            _ => {}
        }
    }
    declared
}

fn parameter(Signal { name, unit, about }: Signal) -> Parameter {
    Parameter { unit, about, ..Parameter::new(&name, f64::NAN) }
}

/// The named values of a message: its numbers with fractions, which no other field of it has.
fn named(channel: &Channel) -> impl Iterator<Item = Signal> + use<> {
    let definition =
        channel.schema.as_ref().and_then(|schema| str::from_utf8(&schema.data).ok()).unwrap_or("");
    let mut descriptions = Description::of_fields(definition);
    let fields =
        Columns::from_definition(definition).map_or_else(Vec::new, |columns| columns.fields().to_vec());
    fields.into_iter().filter(|field| !field.is_integer()).map(move |field| {
        let Description { unit, meaning, .. } = descriptions.remove(field.name()).unwrap_or_default();
        Signal { name: field.name().to_owned(), unit, about: meaning }
    })
}
