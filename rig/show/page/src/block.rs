//! Sections and their blocks. Text in them may mark `code` with backticks.

use serde::Serialize;
use serde_json::Value;

use crate::chart::{Chart, Points};

/// A section of the page.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Section {
    /// Unique in the page.
    pub id: String,
    /// The heading.
    pub title: String,
    /// In its order.
    pub blocks: Vec<Block>,
}

impl Section {
    /// A section of these blocks.
    #[must_use]
    pub fn new(id: &str, title: &str, blocks: Vec<Block>) -> Self {
        Self { id: id.to_owned(), title: title.to_owned(), blocks }
    }
}

/// A part of a section.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Block {
    /// Unique in the page: a live view changes the block by it.
    pub id: String,
    /// Where it is folded at first: what stands there instead.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub folded: Option<String>,
    /// Whether it takes half the width of a wide screen.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_half: bool,
    /// What it shows.
    #[serde(flatten)]
    pub content: Content,
}

impl Block {
    /// A block of this id.
    #[must_use]
    pub fn new(id: impl Into<String>, content: Content) -> Self {
        Self { id: id.into(), folded: None, is_half: false, content }
    }

    /// Folded at first.
    #[must_use]
    pub fn folded(self, summary: impl Into<String>) -> Self {
        Self { folded: Some(summary.into()), ..self }
    }

    /// Half as wide as the page, beside another one.
    #[must_use]
    pub fn half(self) -> Self {
        Self { is_half: true, ..self }
    }

    /// A chart.
    #[must_use]
    pub fn chart(id: impl Into<String>, chart: Chart) -> Self {
        Self::new(id, Content::Chart(Box::new(chart)))
    }

    /// A table.
    #[must_use]
    pub fn table(id: impl Into<String>, table: Table) -> Self {
        Self::new(id, Content::Table(table))
    }

    /// A paragraph.
    #[must_use]
    pub fn text(id: impl Into<String>, text: impl Into<String>) -> Self {
        Self::new(id, Content::Text(text.into()))
    }
}

/// What a block shows. A script of the page draws each kind: `Masseter.block(kind, build)`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", content = "data", rename_all = "snake_case")]
pub enum Content {
    /// A paragraph.
    Text(String),
    /// The judgement.
    Verdict(Verdict),
    /// Rows and columns.
    Table(Table),
    /// Curves.
    Chart(Box<Chart>),
    /// A drawing as SVG text, whose size is in mm.
    Figure(String),
    /// What happened when.
    Events(Events),
    /// The force on each lower tooth.
    Pressure(Pressure),
    /// The mechanism in three dimensions; `scene.js` knows the data.
    Scene(Value),
    /// The views of the jaw; `jaw.js` knows the data.
    Jaw(Value),
    /// The state of a run that goes on.
    Live(Live),
    /// Parameters to change; `live.js` knows the data.
    Parameters(Value),
}

/// The judgement of a run: of its function, and of its timing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// The outcome in a word.
    pub word: String,
    /// The reason in a sentence.
    pub reason: String,
    /// What to do next; none where nothing is to do.
    pub next: Option<String>,
    /// The outcome as a colour.
    pub tone: Tone,
    /// The timing in a word.
    pub timing: String,
    /// More on the timing; may be empty.
    pub timing_reason: String,
    /// The timing as a colour.
    pub timing_tone: Tone,
    /// Figures that matter most, each with its name.
    pub figures: Vec<[String; 2]>,
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Column {
    /// The heading.
    pub title: String,
    /// Whether it holds numbers, which stand at the right.
    pub is_number: bool,
}

impl Column {
    /// Columns of text, by their titles.
    #[must_use]
    pub fn texts(titles: &[&str]) -> Vec<Self> {
        titles.iter().map(|title| Self { title: (*title).to_owned(), is_number: false }).collect()
    }

    /// Columns of numbers, by their titles.
    #[must_use]
    pub fn numbers(titles: &[&str]) -> Vec<Self> {
        titles.iter().map(|title| Self { title: (*title).to_owned(), is_number: true }).collect()
    }
}

/// A cell of a table.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Cell {
    /// Text or a number in words.
    Text(String),
    /// A word that judges.
    Mark {
        /// The word.
        mark: String,
        /// Its colour.
        tone: Tone,
    },
    /// A link to a file beside the page.
    Link {
        /// Its text.
        text: String,
        /// The path of the file, seen from the page.
        href: String,
    },
    /// A time, and a button that shows what was around it.
    Time {
        /// When, s since the first SYNC.
        at_s: f64,
    },
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Self {
        Self::Text(text.into())
    }
}

/// A table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table {
    /// What it holds, for those who cannot see it.
    pub label: String,
    /// From left to right.
    pub columns: Vec<Column>,
    /// As many cells each as columns.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table of these groups of columns, from left to right.
    #[must_use]
    pub fn new(
        label: &str,
        columns: impl IntoIterator<Item = Vec<Column>>,
        rows: impl IntoIterator<Item: IntoIterator<Item: Into<Cell>>>,
    ) -> Self {
        let rows = rows.into_iter().map(|row| row.into_iter().map(Into::into).collect()).collect();
        Self { label: label.to_owned(), columns: columns.into_iter().flatten().collect(), rows }
    }
}

/// The events of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Events {
    /// The events of the start, which are folded.
    pub start: Vec<EventRow>,
    /// All others.
    pub rest: Vec<EventRow>,
}

/// An event.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EventRow {
    /// When, s since the first SYNC.
    pub at_s: f64,
    /// Who reported it.
    pub source: String,
    /// Whether it is a fault.
    pub is_fault: bool,
    /// What happened.
    pub text: String,
}

/// The state of a run that goes on. Its block has a button that ends the run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Live {
    /// The update that the page shows; the next ones follow from it.
    pub number: u64,
    /// The controller's state in a word.
    pub state: String,
    /// The state as a colour.
    pub tone: Tone,
    /// How far the run has come, in a sentence.
    pub progress: String,
    /// Figures that matter most, each with its name.
    pub figures: Vec<[String; 2]>,
}

/// The lower teeth, with the greatest force of all.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pressure {
    /// In any order.
    pub teeth: Vec<Tooth>,
    /// The greatest force on a tooth, N.
    pub most_n: f64,
    /// When all teeth together bear most, s since the first SYNC. The page shows this moment first.
    pub at_s: f64,
}

/// A tooth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tooth {
    /// FDI number.
    pub number: u32,
    /// Where its force acts, seen from above: to the right of the picture, which is the jaw's right side, mm.
    pub across_mm: f64,
    /// The same forward, mm.
    pub forward_mm: f64,
    /// The force by time, N.
    pub points: Points,
}

/// Whether something is as it should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Tone {
    /// It is.
    Good,
    /// It may not be.
    Doubtful,
    /// It is not.
    Bad,
    /// It is not judged.
    Plain,
}
