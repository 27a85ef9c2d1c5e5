//! Moments along the x axis of a chart: a vertical line for each, with its name above the plot.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::canvas::{Area, Chart, Error, TEXT};

/// From one row of names to the next, px.
const ROW: i32 = 16;
/// Most rows of names. A moment without room in any of them has its line alone.
const MOST_ROWS: usize = 6;
/// Width of a character, px; at least that of most.
const CHARACTER: i32 = 7;
/// Between a line and its name, px.
const GAP: i32 = 4;
/// Length of a dash and of the gap after it, px.
const DASH: [i32; 2] = [4, 3];
const COLOUR: RGBColor = RGBColor(0x33, 0x33, 0x33);

/// A moment worth a line.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// Its name.
    pub name: String,
    /// In values of the x axis.
    pub at: f64,
}

/// Where a line and its name stand, px.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place {
    line: i32,
    row: usize,
    /// Of the name.
    ends: [i32; 2],
}

impl Place {
    /// Whether a name, or the line below a name, crosses the other name.
    fn crosses(&self, other: &Self) -> bool {
        let is_crossed = |name: &Self, line: &Self| {
            name.row < line.row && (name.ends[0] - GAP < line.line && line.line < name.ends[1] + GAP)
        };
        let is_one_row = self.row == other.row;
        is_one_row && self.ends[0] - GAP < other.ends[1] && other.ends[0] - GAP < self.ends[1]
            || is_crossed(self, other)
            || is_crossed(other, self)
    }
}

/// Room that the names of these moments may need above a plot, px.
pub(crate) fn room(moments: &[Moment]) -> u32 {
    moments.len().min(MOST_ROWS) as u32 * ROW.unsigned_abs()
}

/// Draws moments on `area` over its chart, which leaves [`room`] above.
pub(crate) fn draw(area: &Area, chart: &Chart<'_, '_>, moments: &[Moment]) -> Result<(), Error> {
    let (left, top) = (area.get_pixel_range().0.start, area.get_pixel_range().1.start);
    let (across, up) = chart.plotting_area().get_pixel_range();
    let (plot_top, bottom) = (up.start - top, up.end - top);
    let low = chart.y_range().start;
    let lines: Vec<i32> =
        moments.iter().map(|moment| chart.backend_coord(&(moment.at, low)).0 - left).collect();
    let widths: Vec<i32> =
        moments.iter().map(|moment| CHARACTER * moment.name.chars().count() as i32).collect();
    let places = places(&lines, &widths, [across.start - left, across.end - left]);
    let text = ("sans-serif", TEXT - 1).into_text_style(area).color(&COLOUR);
    for ((moment, x), place) in moments.iter().zip(lines).zip(places) {
        let mut from = plot_top;
        if let Some(Place { row, ends, .. }) = place {
            from -= ROW * row as i32 + ROW / 2;
            let (side, end) = if ends[0] > x { (HPos::Left, ends[0]) } else { (HPos::Right, ends[1]) };
            area.draw_text(&moment.name, &text.pos(Pos::new(side, VPos::Center)), (end, from))?;
        }
        for y in (from..bottom).step_by(DASH.iter().sum::<i32>() as usize) {
            let dash = [(x, y), (x, (y + DASH[0]).min(bottom))];
            area.draw(&PathElement::new(dash, COLOUR.stroke_width(1)))?;
        }
    }
    Ok(())
}

/// A name stands right of its line, or left of a line close to the plot's right end, in the lowest row with room.
fn places(lines: &[i32], widths: &[i32], [left, right]: [i32; 2]) -> Vec<Option<Place>> {
    let is_left = |index: usize| {
        let needed = GAP + widths[index];
        lines[index] + needed > right && lines[index] - needed >= left
    };
    // The names nearest to the middle of the plot first: the lines of those that follow do not cross them.
    let mut order: Vec<usize> = (0..lines.len()).collect();
    order.sort_by_key(|&index| if is_left(index) { lines[index] } else { -lines[index] });
    let mut places: Vec<Option<Place>> = vec![None; lines.len()];
    for index in order {
        let line = lines[index];
        let from = if is_left(index) { line - GAP - widths[index] } else { line + GAP };
        let place = |row| Place { line, row, ends: [from, from + widths[index]] };
        let is_free = |place: &Place| !places.iter().flatten().any(|other| place.crosses(other));
        places[index] = (0..MOST_ROWS).map(place).find(is_free);
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stand_within_the_plot_and_on_no_other_name_or_line() {
        let (ends, widths) = ([60, 700], [175, 50, 210]);
        for lines in [[100, 100, 101], [300, 304, 690], [690, 695, 700], [60, 400, 500], [300, 690, 310]] {
            let found: Vec<Place> = places(&lines, &widths, ends).into_iter().flatten().collect();
            assert_eq!(found.len(), lines.len(), "{lines:?}: {found:?}");
            for (index, a) in found.iter().enumerate() {
                assert!(ends[0] <= a.ends[0] && a.ends[1] <= ends[1], "{lines:?}: {found:?}");
                for b in &found[..index] {
                    assert!(a.row != b.row || a.ends[1] < b.ends[0] || b.ends[1] < a.ends[0], "{found:?}");
                    for (name, line) in [(a, b), (b, a)] {
                        let is_on = (name.ends[0]..name.ends[1]).contains(&line.line);
                        assert!(line.row <= name.row || !is_on, "{lines:?}: {found:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn more_moments_than_rows_leave_lines_without_names() {
        let found = places(&[300; 20], &[150; 20], [60, 700]);
        assert_eq!(found.iter().flatten().count(), MOST_ROWS);
    }
}
