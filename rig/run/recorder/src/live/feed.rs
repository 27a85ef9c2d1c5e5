//! The figures of a run that goes on, and how its page changes with them.
//!
//! A thread of its own takes the messages. It makes the page ten times a second while a page is open, and keeps what has
//! changed as an update. The recorder never waits for it: a message without room is left out of the page, and is counted.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::{collections::VecDeque, thread, time::Duration};

use masseter_judge::Analysis;
use masseter_page::{Block, Chart, Content, Page, PageError, Section};
use masseter_recording::{Manifest, Recorded};
use masseter_runtime::clock::{self, SECOND_NS};
use masseter_runtime::named::Declared;
use serde_json::{Value, json};

/// Messages that may wait: almost half a second of every topic at 1 kHz.
const QUEUE: usize = 8192;
/// Time between two updates: ten a second.
const INTERVAL: Duration = Duration::from_millis(100);
/// Tables and the like change with every tenth update.
const WHOLE: u64 = 10;
/// Updates kept for pages that lag: five seconds.
const KEPT: usize = 50;
/// Somebody watches as long as a page has asked within this time, ns.
const WATCHED_NS: u64 = SECOND_NS;

/// A curve's newest points may still change, s: they belong to a stretch of time that is not over.
const UNSETTLED_S: f64 = 0.1;

/// What a page gets next.
#[derive(Debug)]
pub(super) enum Next {
    /// An update as JSON.
    Update(Arc<str>),
    /// Nothing yet.
    None,
    /// The update is not kept any more.
    Lost,
}

/// The page of a run that goes on.
#[derive(Debug)]
pub(super) struct Feed {
    queue: SyncSender<Recorded>,
    dropped: AtomicU64,
    asked_ns: AtomicU64,
    analysis: Mutex<Analysis>,
    shown: Mutex<Shown>,
}

/// The page as it was made last, and the updates that led there.
#[derive(Debug)]
struct Shown {
    manifest: Manifest,
    page: Page,
    updates: VecDeque<Arc<str>>,
    /// Updates made so far.
    count: u64,
}

impl Feed {
    /// Starts its thread.
    ///
    /// # Errors
    /// When the system refuses the thread.
    pub(super) fn start(manifest: Manifest, declared: &Declared) -> std::io::Result<Arc<Self>> {
        let analysis = Analysis::while_running(&manifest.scenario, declared);
        let page = masseter_report::page_so_far(&manifest, &analysis.clone().finish(false, &[]), 0, 0);
        let (queue, queued) = sync_channel(QUEUE);
        let shown = Shown { manifest, page, updates: VecDeque::new(), count: 0 };
        let feed = Arc::new(Self {
            queue,
            dropped: AtomicU64::new(0),
            asked_ns: AtomicU64::new(0),
            analysis: Mutex::new(analysis),
            shown: Mutex::new(shown),
        });
        let taken = Arc::downgrade(&feed);
        thread::Builder::new().spawn(move || {
            while let Some(feed) = taken.upgrade() {
                feed.gather(&queued);
                if feed.is_watched() {
                    feed.refresh();
                }
            }
        })?;
        Ok(feed)
    }

    /// Queues a message. Never waits.
    pub(super) fn offer(&self, message: &Recorded) {
        if let Err(TrySendError::Full(_)) = self.queue.try_send(*message) {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Takes messages for the time between two updates.
    fn gather(&self, queued: &Receiver<Recorded>) {
        let until_ns = clock::now_ns() + INTERVAL.as_nanos() as u64;
        loop {
            let left = Duration::from_nanos(until_ns.saturating_sub(clock::now_ns()));
            match queued.recv_timeout(left) {
                Ok(message) => {
                    let mut analysis = lock(&self.analysis);
                    // A message that is no frame is in the recording, whose report names it.
                    let _ = analysis.take(&message);
                    while let Ok(message) = queued.try_recv() {
                        let _ = analysis.take(&message);
                    }
                }
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn is_watched(&self) -> bool {
        clock::now_ns().saturating_sub(self.asked_ns.load(Ordering::Relaxed)) < WATCHED_NS
    }

    /// Makes the page anew, and an update of what has changed.
    pub(super) fn refresh(&self) {
        drop(self.renewed(false));
    }

    /// `is_asked`: somebody gets the page itself.
    fn renewed(&self, is_asked: bool) -> MutexGuard<'_, Shown> {
        let mut shown = lock(&self.shown);
        let analysis = lock(&self.analysis).clone();
        let figures = analysis.finish(false, &[]);
        let count = shown.count + 1;
        let dropped = self.dropped.load(Ordering::Relaxed);
        let mut page = masseter_report::page_so_far(&shown.manifest, &figures, count, dropped);
        let is_whole = is_asked || count.is_multiple_of(WHOLE);
        let update = changes_between(&shown.page, &mut page, is_whole);
        shown.updates.push_back(update.to_string().into());
        if shown.updates.len() > KEPT {
            shown.updates.pop_front();
        }
        (shown.page, shown.count) = (page, count);
        shown
    }

    /// The page at this moment, as HTML.
    pub(super) fn html(&self) -> Result<String, PageError> {
        self.asked_ns.store(clock::now_ns(), Ordering::Relaxed);
        self.renewed(true).page.to_html()
    }

    /// The update after the one of this number.
    pub(super) fn after(&self, number: u64) -> Next {
        self.asked_ns.store(clock::now_ns(), Ordering::Relaxed);
        let shown = lock(&self.shown);
        let first = shown.count - shown.updates.len() as u64;
        if number >= shown.count {
            return Next::None;
        }
        let place = number.checked_sub(first).and_then(|place| shown.updates.get(place as usize));
        place.map_or(Next::Lost, |update| Next::Update(Arc::clone(update)))
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The update that makes the second page of the first, as JSON for the page's script. Curves and frames of the scene only
/// grow: their new points are appended. Every other block is replaced where it differs, and so is a section with other blocks.
/// Unless it is a whole one, drawings that take long stay as before, also in the second page.
fn changes_between(before: &Page, now: &mut Page, is_whole: bool) -> Value {
    let [from_s, to_s] = [before.time.end_s, now.time.end_s].map(|end_s| end_s - UNSETTLED_S);
    let mut changes = Changes { from_s, to_s, is_whole, append: Vec::new(), update: Vec::new() };
    let mut sections = Vec::new();
    let mut above = None;
    for section in &mut now.sections {
        let earlier = before.sections.iter().find(|earlier| earlier.id == section.id);
        if earlier.is_none_or(|earlier| !changes.add_section(earlier, section)) {
            sections.push(json!([above, section]));
        }
        above = Some(section.id.clone());
    }
    let mut update = json!({ "end_s": now.time.end_s, "append": changes.append, "update": changes.update });
    if now.time.motion_s != before.time.motion_s {
        update["motion_s"] = json!(now.time.motion_s);
    }
    if now.moments.len() > before.moments.len() {
        update["mark"] = json!(now.moments[before.moments.len()..]);
    }
    if now.phases.len() > before.phases.len() {
        update["enter"] = json!(now.phases[before.phases.len()..]);
    }
    if !sections.is_empty() {
        update["sections"] = Value::Array(sections);
    }
    update
}

/// The parts of an update that concern single blocks.
struct Changes {
    /// The stretch of time whose points have settled since the page before, s.
    from_s: f64,
    to_s: f64,
    is_whole: bool,
    append: Vec<Value>,
    update: Vec<Value>,
}

impl Changes {
    fn has_settled(&self, at_s: f64) -> bool {
        at_s > self.from_s && at_s <= self.to_s
    }

    /// False where the section has other blocks now.
    fn add_section(&mut self, before: &Section, now: &mut Section) -> bool {
        let is_same =
            before.blocks.iter().map(|block| &block.id).eq(now.blocks.iter().map(|block| &block.id));
        if is_same {
            let blocks = before.blocks.iter().zip(&mut now.blocks);
            blocks.for_each(|(before, now)| self.add_block(before, now));
        }
        is_same
    }

    fn add_block(&mut self, before: &Block, now: &mut Block) {
        match (&before.content, &now.content) {
            (Content::Chart(before), Content::Chart(chart)) if only_grows(before, chart) => {
                self.add_chart(&now.id, chart);
            }
            (Content::Scene(_), Content::Scene(scene)) => self.add_scene(&now.id, scene),
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

    fn add_chart(&mut self, id: &str, chart: &Chart) {
        for series in &chart.series {
            let points = series.points.iter().filter(|(at_s, _)| self.has_settled(*at_s));
            let flat: Vec<_> = points.flat_map(|(at_s, value)| [at_s, value]).collect();
            if !flat.is_empty() {
                self.append.push(json!([id, series.name, flat]));
            }
        }
    }

    fn add_scene(&mut self, id: &str, scene: &Value) {
        for what in ["frames", "forces"] {
            let Some(moments) = scene[what].as_array() else { continue };
            let is_new = |moment: &&Value| moment[0].as_f64().is_some_and(|at_s| self.has_settled(at_s));
            let moments: Vec<_> = moments.iter().filter(is_new).collect();
            if !moments.is_empty() {
                self.append.push(json!([id, what, moments]));
            }
        }
    }
}

/// Whether a chart only has more points than before: it is over time, and has the same curves and limits.
fn only_grows(before: &Chart, now: &Chart) -> bool {
    let names = |chart: &Chart| chart.series.iter().map(|series| series.name.clone()).collect::<Vec<_>>();
    now.is_over_time() && names(before) == names(now) && before.limits == now.limits
}
