//! The tables of docs/interface.md are those of the messages, and name what the C headers, the scenario and the codes have.

use std::collections::BTreeSet;
use std::fs;

use masseter_runtime::messages::codes::Cause;
use masseter_runtime::messages::{
    Command, Contact, Event, Field, FrameTap, Machine, Message, Parameters, Reading, Signals, State, Truth,
};
use masseter_scenario::Scenario;

use super::project;

/// A message as the document may name it.
struct Layout {
    topic: &'static str,
    about: &'static str,
    fields: Vec<Field>,
}

fn layout<M: Message>() -> Layout {
    Layout { topic: M::TOPIC, about: M::about(), fields: M::fields() }
}

/// The messages that concern a controller.
fn layouts() -> [Layout; 8] {
    [
        layout::<Reading>(),
        layout::<Command>(),
        layout::<State>(),
        layout::<Event>(),
        layout::<Truth>(),
        layout::<Contact>(),
        layout::<Signals>(),
        layout::<Parameters>(),
    ]
}

fn file(name: &str) -> String {
    fs::read_to_string(project().join(name)).unwrap()
}

fn document() -> String {
    file("docs/interface.md")
}

/// The rows of the table with this head, cell by cell.
pub(super) fn table<'a>(text: &'a str, head: &str) -> Vec<Vec<&'a str>> {
    let (_, rows) = text.split_once(head).unwrap_or_else(|| panic!("no table {head}"));
    let rows = rows.lines().skip(2).take_while(|line| line.starts_with('|'));
    rows.map(|row| row.trim_matches('|').split('|').map(str::trim).collect()).collect()
}

/// What stands between backquotes, outside of blocks.
fn names(text: &str) -> impl Iterator<Item = &str> {
    let lines = text.lines().filter(|line| !line.starts_with("    "));
    lines.flat_map(|line| line.split('`').skip(1).step_by(2))
}

/// The unit that a field's name ends with; empty for a number without one.
fn unit(field: &str) -> &'static str {
    let units = [("_m_s", "m/s"), ("_m", "m"), ("_n", "N"), ("_ns", "ns"), ("_rad", "rad"), ("_time_s", "s")];
    units.iter().find(|(end, _)| field.ends_with(end)).map_or("", |(_, unit)| unit)
}

#[test]
fn the_table_of_topics_is_that_of_the_messages() {
    let text = document();
    let rows = table(&text, "| topic | from | to | once a cycle |");
    let topics: BTreeSet<_> = rows.iter().map(|row| row[0].trim_matches('`')).collect();
    assert_eq!(topics.len(), rows.len(), "a topic stands there twice");
    let layouts = layouts();
    assert_eq!(topics, layouts.iter().map(|layout| layout.topic).collect());
    for row in &rows {
        let layout = layouts.iter().find(|layout| layout.topic == row[0].trim_matches('`')).unwrap();
        let is_each_cycle = layout.about.contains("once a cycle");
        assert_eq!(!row[3].starts_with("no:"), is_each_cycle, "{row:?}: {}", layout.about);
    }
}

#[test]
fn the_table_of_fields_has_the_fields_and_units_of_the_messages() {
    let text = document();
    let layouts = layouts();
    let rows = table(&text, "| field | unit | meaning |");
    assert!(rows.len() > 10, "{rows:?}");
    for row in &rows {
        for name in names(row[0]) {
            let (topic, field) = name.split_once('.').unwrap();
            let layout = layouts.iter().find(|layout| layout.topic == topic);
            let layout = layout.unwrap_or_else(|| panic!("no topic {topic}"));
            assert!(layout.fields.iter().any(|known| known.name == field), "{topic} has no field {field}");
            assert_eq!(row[1], unit(field), "{name}");
        }
    }
    // A controller of the drives must fill what the rig reads of a command.
    let filled = names(&text).filter_map(|name| name.strip_prefix("command.")).collect::<BTreeSet<_>>();
    let stamped = ["seq", "published_ns", "version"];
    let fields = layouts[1].fields.iter().map(|field| field.name).filter(|name| !stamped.contains(name));
    assert_eq!(filled, fields.collect());
}

#[test]
fn the_meaning_of_every_field_names_the_unit_in_its_name() {
    let others = [layout::<FrameTap>(), layout::<Machine>()];
    let layouts: Vec<_> = layouts().into_iter().chain(others).collect();
    let mut with_unit = 0;
    for Layout { topic, fields, .. } in &layouts {
        for Field { name, about, .. } in fields {
            let unit = unit(name);
            if unit.is_empty() {
                continue;
            }
            let named = about.match_indices(&format!(", {unit}")).any(|(at, found)| {
                !about[at + found.len()..].starts_with(|next: char| next.is_alphanumeric() || next == '/')
            });
            assert!(named, "{topic}.{name} is in {unit}, its description is '{about}'");
            with_unit += 1;
        }
    }
    assert!(with_unit > 30, "only {with_unit} fields have a unit");
}

#[test]
fn every_field_function_cause_and_key_that_the_document_names_exists() {
    let text = document();
    let layouts = layouts();
    let headers =
        file("rig/bindings/interface/masseter.h") + &file("rig/bindings/interface/masseter_messages.h");
    let scenario = Scenario::default().to_toml();
    let causes: Vec<_> = Cause::ALL.iter().map(|cause| cause.name()).collect();
    let [mut fields, mut functions, mut named_causes, mut named_keys] = [0; 4];
    for name in names(&text) {
        if let Some((before, after)) = name.split_once('.')
            && let Some(layout) = layouts.iter().find(|layout| layout.topic == before)
        {
            assert!(layout.fields.iter().any(|field| field.name == after), "no field {name}");
            fields += 1;
        } else if let Some((section, key)) = name.split_once('.')
            && let Some((_, keys)) = scenario.split_once(&format!("\n[{section}]\n"))
        {
            let mut keys = keys.lines().take_while(|line| !line.starts_with('['));
            assert!(keys.any(|line| line.split(' ').next() == Some(key)), "no key {name}");
            named_keys += 1;
        } else if name.starts_with("masseter_") && name.chars().all(|sign| sign.is_lowercase() || sign == '_')
        {
            assert!(headers.contains(&format!("{name}(")), "no function {name}");
            functions += 1;
        } else if causes.contains(&name) {
            named_causes += 1;
        }
    }
    assert!(fields > 10 && functions > 6 && named_causes > 3 && named_keys > 1);
    // Every cause that the table of reactions names in brackets is one.
    let reactions = table(&text, "| the controller | who reacts | reaction |");
    for name in reactions.iter().flat_map(|row| names(row[2])) {
        let is_option = name.starts_with("--");
        assert!(is_option || causes.contains(&name), "{name} is no cause");
    }
}
