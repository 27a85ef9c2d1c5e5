//! What differs between a page and the same page a moment later, as JSON for the page's script.
//!
//! Curves and frames of the scene only grow: their new points are appended. Every other block is replaced where it differs, and
//! so is a section with other blocks.

use masseter_page::{Block, Chart, Content, Page, Section};
use serde_json::{Map, Value, json};

/// A curve's newest points may still change, s: they belong to a stretch of time that is not over.
const UNSETTLED_S: f64 = 0.1;

/// The update that makes the second page of the first. Unless it is a `whole` one, what is slow to draw stays as before, also in
/// the second page.
pub(super) fn between(before: &Page, now: &mut Page, is_whole: bool) -> Value {
    let settled = Settled { from_s: before.time.end_s - UNSETTLED_S, to_s: now.time.end_s - UNSETTLED_S };
    let mut changes = Changes { settled, is_whole, append: Vec::new(), update: Vec::new() };
    let mut sections = Vec::new();
    let mut above = None;
    for section in &mut now.sections {
        let earlier = before.sections.iter().find(|earlier| earlier.id == section.id);
        if earlier.is_none_or(|earlier| !changes.section(earlier, section)) {
            sections.push(json!([above, section]));
        }
        above = Some(section.id.clone());
    }
    let mut update = Map::new();
    let mut put = |name: &str, value: Value| update.insert(name.to_owned(), value);
    put("end_s", json!(now.time.end_s));
    if now.time.motion_s != before.time.motion_s {
        put("motion_s", json!(now.time.motion_s));
    }
    if now.moments.len() > before.moments.len() {
        put("mark", json!(now.moments[before.moments.len()..]));
    }
    if now.phases.len() > before.phases.len() {
        put("enter", json!(now.phases[before.phases.len()..]));
    }
    put("append", Value::Array(changes.append));
    put("update", Value::Array(changes.update));
    if !sections.is_empty() {
        put("sections", Value::Array(sections));
    }
    Value::Object(update)
}

/// The stretch of time whose points have settled since the page before.
#[derive(Debug, Clone, Copy)]
struct Settled {
    from_s: f64,
    to_s: f64,
}

impl Settled {
    fn contains(self, at_s: f64) -> bool {
        at_s > self.from_s && at_s <= self.to_s
    }
}

struct Changes {
    settled: Settled,
    is_whole: bool,
    append: Vec<Value>,
    update: Vec<Value>,
}

impl Changes {
    /// False where the section has other blocks now.
    fn section(&mut self, before: &Section, now: &mut Section) -> bool {
        let is_same =
            before.blocks.iter().map(|block| &block.id).eq(now.blocks.iter().map(|block| &block.id));
        if is_same {
            let blocks = before.blocks.iter().zip(&mut now.blocks);
            blocks.for_each(|(before, now)| self.block(before, now));
        }
        is_same
    }

    fn block(&mut self, before: &Block, now: &mut Block) {
        match (&before.content, &now.content) {
            (Content::Chart(before), Content::Chart(chart)) if grows(before, chart) => {
                self.chart(&now.id, chart);
            }
            (Content::Scene(_), Content::Scene(scene)) => self.scene(&now.id, scene),
            (before, content) if before != content => {
                if !self.is_whole && !matches!(content, Content::Live(_)) {
                    now.content = before.clone();
                    return;
                }
                let content = serde_json::to_value(content).unwrap_or_default();
                self.update.push(json!([now.id, content["data"]]));
            }
            _ => {}
        }
    }

    fn chart(&mut self, id: &str, chart: &Chart) {
        for series in &chart.series {
            let points = series.points.iter().filter(|(at_s, _)| self.settled.contains(*at_s));
            let flat: Vec<_> = points.flat_map(|(at_s, value)| [at_s, value]).collect();
            if !flat.is_empty() {
                self.append.push(json!([id, series.name, flat]));
            }
        }
    }

    fn scene(&mut self, id: &str, scene: &Value) {
        for what in ["frames", "forces"] {
            let Some(moments) = scene[what].as_array() else { continue };
            let is_new = |moment: &&Value| moment[0].as_f64().is_some_and(|at_s| self.settled.contains(at_s));
            let moments: Vec<_> = moments.iter().filter(is_new).collect();
            if !moments.is_empty() {
                self.append.push(json!([id, what, moments]));
            }
        }
    }
}

/// Whether a chart only has more points than before: it is over time, and has the same curves and limits.
fn grows(before: &Chart, now: &Chart) -> bool {
    let names = |chart: &Chart| chart.series.iter().map(|series| series.name.clone()).collect::<Vec<_>>();
    now.is_over_time() && names(before) == names(now) && before.limits == now.limits
}
