//! Deviations of all drives as one table.

use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_plant::bringup::{Deviation, Outcome};

const HEAD: [&str; 6] = ["axis", "object", "wanted", "found", "configure", "decided by"];

/// Names of axes; all of them in one word.
pub(crate) fn axes_text(axes: &[usize]) -> String {
    if axes.len() == AXES {
        return "all".to_owned();
    }
    axes.iter().map(|&axis| AXIS_NAMES[axis]).collect::<Vec<_>>().join(" ")
}

/// The table; equal deviations of several drives share a row. Empty without a deviation.
pub(crate) fn table(deviations: &[(usize, Deviation)]) -> String {
    let mut rows: Vec<(Vec<usize>, &Deviation)> = Vec::new();
    for (axis, deviation) in deviations {
        match rows.iter_mut().find(|(_, known)| *known == deviation) {
            Some((axes, _)) => axes.push(*axis),
            None => rows.push((vec![*axis], deviation)),
        }
    }
    let cells = rows.iter().map(|(axes, deviation)| {
        let remedy = match deviation.outcome {
            Outcome::Mended => deviation.remedy.clone(),
            Outcome::Doubtful => format!("(look) {}", deviation.remedy),
            Outcome::Refused => format!("REFUSES: {}", deviation.remedy),
        };
        let object = format!("{} {}", deviation.object, deviation.name).trim_end().to_owned();
        let (wanted, found) = (deviation.wanted.clone(), deviation.found.clone());
        [axes_text(axes), object, wanted, found, remedy, deviation.key.clone()]
    });
    let cells: Vec<_> = cells.collect();
    if cells.is_empty() {
        return String::new();
    }
    let head = HEAD.map(str::to_owned);
    let all = || [&head].into_iter().chain(&cells);
    let widths: [usize; 6] =
        std::array::from_fn(|column| all().map(|row| row[column].chars().count()).max().unwrap_or_default());
    let line = |row: &[String; 6]| {
        let padded: Vec<_> = row.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
        padded.join("  ").trim_end().to_owned() + "\n"
    };
    all().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_deviations_share_a_row() {
        let deviation = |wanted: &str| Deviation {
            object: "6066h:00h".to_owned(),
            name: "Following error time out",
            wanted: wanted.to_owned(),
            found: "0".to_owned(),
            outcome: Outcome::Mended,
            remedy: format!("write {wanted}"),
            key: "key".to_owned(),
        };
        let mut all: Vec<_> = (0..AXES).map(|axis| (axis, deviation("20"))).collect();
        all.push((3, deviation("7")));
        let text = table(&all);
        let rows: Vec<_> = text.lines().collect();
        assert_eq!(rows.len(), 3, "{text}");
        assert!(rows[1].starts_with("all   6066h:00h Following error time out  20"), "{text}");
        assert!(rows[2].starts_with("l1 "), "{text}");
        assert_eq!(table(&[]), "");
    }
}
