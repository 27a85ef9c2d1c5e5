//! A recorded motion against the played one: a table of errors, and the jaw's figures in a sentence.

use masseter_judge::{RecordedError, RecordedFigures};
use masseter_page::{Block, Column, Table};

pub(super) fn recorded_blocks(figures: &RecordedFigures) -> [Block; 2] {
    let row = |error: &RecordedError| {
        let share = error.share.map_or_else(|| "–".to_owned(), |share| format!("{:.0} %", share * 100.0));
        let numbers = [error.rms, error.p95, error.max].map(|value| format!("{value:.4} {}", error.unit));
        let [rms, p95, max] = numbers;
        [error.place.to_owned(), error.source.to_owned(), rms, p95, max, share]
    };
    let columns = [
        Column::texts(&["recorded against played", "by"]),
        Column::numbers(&["rms", "95 %", "max", "share of the mean square"]),
    ];
    let table = Table::new("Recorded against played", columns, figures.errors.iter().map(row));
    [Block::table("recorded", table), Block::text("recorded-in-words", figures.in_words())]
}
