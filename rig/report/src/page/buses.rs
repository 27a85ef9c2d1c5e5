//! Messages and losses, the load of the buses, and the response times of their messages.

use masseter_analysis::{BusResponse, Figures, ResponseFigures, TopicFigures};
use masseter_page::{Block, Cell, Chart, Column, Section, Table, Tone};

use super::charts::{limit, plain};
use crate::text::{grouped, microseconds, or_dash};

/// What stands in the place of all that the frames would show.
const WITHOUT_FRAMES: &str = "The CAN frames are not recorded (recording.frames = false): the run has no load of the buses, no \
     response times and no candump logs.";

pub(super) fn section(figures: &Figures) -> Section {
    let mut blocks = match figures.frames {
        Some(_) => of_frames(figures),
        None => vec![Block::text("buses", WITHOUT_FRAMES.to_owned())],
    };
    blocks.push(Block::table("topics", topics(&figures.topics)).folded(topics_in_words(&figures.topics)));
    Section::new("messages", "Messages and buses", blocks)
}

fn of_frames(figures: &Figures) -> Vec<Block> {
    let response = &figures.bus_response;
    let mut blocks = vec![
        Block::chart("buses", load(figures)),
        Block::table("responses", responses(&response.messages)).folded(responses_in_words(response)),
    ];
    if let Some(why) = &response.unbounded {
        blocks.push(Block::text("unbounded", format!("No bounds hold for this run: {why}.")));
    }
    blocks
}

fn responses_in_words(response: &BusResponse) -> String {
    let tightest = response.tightest().map_or_else(String::new, |message| {
        let us = |ns: Option<u64>| or_dash(ns, microseconds);
        let (max, bound) = (us(message.max_ns), us(message.bound_ns));
        format!("; closest to its bound: {} on can{} with {max} of {bound} µs", message.message, message.bus)
    });
    format!(
        "Response times from the queueing to the end of a frame, beside the worst case by the plan{tightest}"
    )
}

fn topics_in_words(topics: &[TopicFigures]) -> String {
    let sum = |count: fn(&TopicFigures) -> u64| grouped(topics.iter().map(count).sum());
    format!("Messages: {} recorded, {} dropped", sum(|topic| topic.messages), sum(|topic| topic.missing))
}

/// Share of each bus in use.
fn load(figures: &Figures) -> Chart {
    let loads = figures.over_time.bus_load.iter().enumerate();
    Chart {
        series: loads.map(|(bus, load)| plain(&format!("can{bus}"), load, 100.0)).collect(),
        limits: vec![limit("full", &[100.0])],
        otherwise: "No frame was recorded.".to_owned(),
        ..Chart::over_time("Load of the buses", "%")
    }
}

fn responses(messages: &[ResponseFigures]) -> Table {
    let row = |message: &ResponseFigures| -> Vec<Cell> {
        let us = |ns: Option<u64>| or_dash(ns, microseconds);
        let max = us(message.max_ns);
        let max = if message.exceeds() { Cell::Mark { mark: max, tone: Tone::Bad } } else { max.into() };
        let name = format!("can{} {}", message.bus, message.message);
        vec![name.into(), message.frames.to_string().into(), max, us(message.bound_ns).into()]
    };
    let numbers = ["frames", "max, µs", "bound, µs"].map(Column::number);
    Table {
        label: "Response times of the buses' messages".to_owned(),
        columns: [Column::text("message")].into_iter().chain(numbers).collect(),
        rows: messages.iter().map(row).collect(),
    }
}

fn topics(topics: &[TopicFigures]) -> Table {
    let row = |topic: &TopicFigures| -> Vec<Cell> {
        vec![topic.topic.into(), topic.messages.to_string().into(), topic.missing.to_string().into()]
    };
    Table {
        label: "Messages of the topics".to_owned(),
        columns: vec![Column::text("topic"), Column::number("messages"), Column::number("dropped")],
        rows: topics.iter().map(row).collect(),
    }
}
