//! The messages of a recording, by topic, as the bytes of their structures.

use std::collections::BTreeMap;
use std::path::PathBuf;

use masseter_recording::{Reader, Recorded};
use masseter_runtime::messages::{
    Command, Contact, Event, Message, Parameters, Reading, Signals, State, Truth,
};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::failed;

/// The messages of each topic that controllers use, in order, and whether the recording is whole.
#[pyfunction]
pub(crate) fn topics(
    py: Python<'_>,
    path: PathBuf,
) -> PyResult<(BTreeMap<&'static str, Bound<'_, PyBytes>>, bool)> {
    let read = py.detach(|| read(&path));
    let (topics, is_whole) = read.map_err(|error| failed(format!("{}: {error}", path.display())))?;
    Ok((topics.into_iter().map(|(name, bytes)| (name, PyBytes::new(py, &bytes))).collect(), is_whole))
}

type Topics = BTreeMap<&'static str, Vec<u8>>;

fn read(path: &std::path::Path) -> Result<(Topics, bool), masseter_recording::ReadError> {
    let mut reader = Reader::open(path)?;
    let names = [
        Reading::TOPIC,
        Command::TOPIC,
        State::TOPIC,
        Event::TOPIC,
        Truth::TOPIC,
        Contact::TOPIC,
        Signals::TOPIC,
        Parameters::TOPIC,
    ];
    let mut topics: Topics = names.map(|name| (name, Vec::new())).into_iter().collect();
    while let Some(message) = reader.next_message()? {
        let (name, body) = match &message {
            Recorded::Reading(message) => (Reading::TOPIC, message.body()),
            Recorded::Command(message) => (Command::TOPIC, message.body()),
            Recorded::State(message) => (State::TOPIC, message.body()),
            Recorded::Event(message) => (Event::TOPIC, message.body()),
            Recorded::Truth(message) => (Truth::TOPIC, message.body()),
            Recorded::Contact(message) => (Contact::TOPIC, message.body()),
            Recorded::Signals(message) => (Signals::TOPIC, message.body()),
            Recorded::Parameters(message) => (Parameters::TOPIC, message.body()),
            _ => continue,
        };
        topics.entry(name).or_default().extend_from_slice(body);
    }
    Ok((topics, reader.damage().is_empty() && !reader.was_cut_short()))
}
