//! The cycles of the jaw as rows of a table, for `masseter export` and `masseter compare`. A row names its run by pseudonyms only.

use masseter_judge::{JawCycle, QUANTITIES};
use masseter_table::{Cell, Column, Table, Values};

/// Whose cycles they are.
#[derive(Debug, Clone, Copy)]
pub struct JawCyclesOf<'a> {
    /// Pseudonym of the person.
    pub person: &'a str,
    /// Name of the session, or another condition.
    pub condition: &'a str,
    /// Number of the recording, from 1.
    pub recording: i64,
}

/// The table with the cycles of these recordings.
pub fn jaw_cycle_table<'a>(of: impl IntoIterator<Item = (JawCyclesOf<'a>, &'a [JawCycle])>) -> Table {
    let words = |name, about| Column::new(name, "", about, Values::Words(Vec::new()));
    let whole = |name, about| Column::new(name, "", about, Values::Whole(Vec::new()));
    let number = |name, unit, about: &str| Column::new(name, unit, about, Values::Numbers(Vec::new()));
    let numbers = QUANTITIES.map(|of| number(of.name, of.unit, &format!("{}.", of.about)));
    let first = [
        words("patient", "Pseudonym of the person; none where the run names none."),
        words("session", "Session, or another condition; none where the run names none."),
        whole("recording", "Number of the recording."),
        whole("cycle", "Number of the cycle in its recording."),
        words("kind", "Kind of the cycle."),
        words("side", "Side of the cycle; none of kinds without one."),
        words("left_out", "Why the cycle does not count; none of one that counts."),
        number("began_s", "s", "Beginning, since the motion began."),
    ];
    let mut table = Table::new(first.into_iter().chain(numbers).collect());
    for (JawCyclesOf { person, condition, recording }, cycles) in of {
        for cycle in cycles {
            let word = |text: &str| Cell::Word(Some(text.to_owned()).filter(|text| !text.is_empty()));
            let first = [
                word(person),
                word(condition),
                Cell::Whole(Some(recording)),
                Cell::Whole(Some(cycle.number.cast_signed())),
                word(cycle.kind.word()),
                Cell::Word(cycle.side.map(|side| side.word().to_owned())),
                Cell::Word(cycle.left_out.map(|why| why.word().to_owned())),
                Cell::Number(Some(cycle.began_s)),
            ];
            table.push(first.into_iter().chain(QUANTITIES.map(|of| Cell::Number((of.value)(cycle)))));
        }
    }
    table
}
