//! The cycles of the jaw as rows of a table, for `masseter export` and `masseter compare`. A row names its run by pseudonyms only.

use masseter_judge::{JawCycle, QUANTITIES};
use masseter_table::{Cell, Column, Table, Values};

pub(crate) fn words(name: &str, about: &str) -> Column {
    Column::new(name, "", about, Values::Words(Vec::new()))
}

pub(crate) fn whole(name: &str, about: &str) -> Column {
    Column::new(name, "", about, Values::Whole(Vec::new()))
}

pub(crate) fn number(name: &str, unit: &str, about: &str) -> Column {
    Column::new(name, unit, about, Values::Numbers(Vec::new()))
}

/// The columns that name a recording.
pub(crate) fn recording_columns() -> [Column; 3] {
    [
        words("patient", "Pseudonym of the person; none where the run names none."),
        words("session", "Session, or another condition; none where the run names none."),
        whole("recording", "Number of the recording."),
    ]
}

/// A recording by the pseudonyms of person and condition, and its number.
pub(crate) fn recording_cells([person, condition]: [&str; 2], number: i64) -> [Cell; 3] {
    [word(person), word(condition), Cell::Whole(Some(number))]
}

pub(crate) fn word(text: &str) -> Cell {
    Cell::Word(Some(text.to_owned()).filter(|text| !text.is_empty()))
}

/// The table with the cycles of recordings, each with the pseudonyms of person and condition.
pub fn jaw_cycle_table<'a>(of: impl IntoIterator<Item = ([&'a str; 2], &'a [JawCycle])>) -> Table {
    let about = [
        whole("cycle", "Number of the cycle in its recording."),
        words("kind", "Kind of the cycle."),
        words("side", "Side of the cycle; none of kinds without one."),
        words("left_out", "Why the cycle does not count; none of one that counts."),
        number("began_s", "s", "Beginning, since the motion began."),
    ];
    let numbers = QUANTITIES.map(|(of, _)| number(of.name, of.unit, &format!("{}.", of.about)));
    let mut table = Table::new(recording_columns().into_iter().chain(about).chain(numbers).collect());
    for (recording, (names, cycles)) in (1..).zip(of) {
        for cycle in cycles {
            let about = [
                Cell::Whole(Some(cycle.number.cast_signed())),
                word(&cycle.kind.to_string()),
                Cell::Word(cycle.side.map(|side| side.to_string())),
                Cell::Word(cycle.left_out.map(|why| why.to_string())),
                Cell::Number(Some(cycle.began_s)),
            ];
            let numbers = QUANTITIES.map(|(_, value)| Cell::Number(value(cycle)));
            table.push(recording_cells(names, recording).into_iter().chain(about).chain(numbers));
        }
    }
    table
}
