//! The page of a campaign, drawn as the page of a run: its result with a histogram of margins, margins against factors, two factors at a time, the reasons
//! of the cases that did not pass, and the worst cases.

use masseter_page::{
    Across, Block, Cell, Chart, Column, Content, Dot, LevelKind, Life, Limit, Page, PageError, Scale,
    Section, Series, Table, Time, Tone, Verdict, margin_histogram,
};

use crate::case::{CaseResult, check_names, in_order_of_appearance};
use crate::factor::{Distribution, Setting};
use crate::report::{Report, WorstCase, percent};

/// Height of a plot, px.
const HEIGHT: u32 = 220;
/// So many factors are drawn two at a time: those that move the smallest margin most.
const PAIRED: usize = 3;

pub(crate) fn html(report: &Report<'_>, worst: &[WorstCase]) -> Result<String, PageError> {
    let sections = [
        Some(result(report)),
        margins(report, worst),
        pairs(report, worst),
        reasons(report, worst),
        worst_cases(report, worst),
    ];
    let about = format!("{} of {} cases", report.results.len(), report.campaign.case_count());
    let page = Page::new("Campaign", Life::Finished, Time::default());
    Page { about, sections: sections.into_iter().flatten().collect(), ..page }.to_html()
}

fn result(report: &Report<'_>) -> Section {
    let is_success = report.is_success();
    let rate = report.rate();
    let share = rate.share().map_or_else(|| "none judged".to_owned(), percent);
    let [low, high] = rate.interval.map(percent);
    let counts: Vec<_> = report.counts().iter().map(|(word, count)| format!("{count} {word}")).collect();
    let demanded =
        report.campaign.file.least_success.map(|least| ["demanded", &percent(least)].map(str::to_owned));
    let figures = [
        ["success rate", &share],
        ["95 % interval", &format!("{low} to {high}")],
        ["judged", &rate.judged.to_string()],
    ];
    let verdict = Verdict {
        word: if is_success { "PASS" } else { "FAIL" }.to_owned(),
        reason: counts.join(", "),
        next: (!is_success).then(|| "Open the report of a worst case below.".to_owned()),
        tone: if is_success { Tone::Good } else { Tone::Bad },
        timing: "simulated".to_owned(),
        timing_reason: String::new(),
        timing_tone: Tone::Plain,
        figures: figures.map(|figure| figure.map(str::to_owned)).into_iter().chain(demanded).collect(),
    };
    let margins: Vec<_> = report.results.iter().filter_map(|result| Some(result.least_margin()?.1)).collect();
    let histogram = margin_histogram("Cases by their smallest margin", "case", &margins);
    let histogram = histogram.map(|chart| Block::chart("smallest-margins", chart));
    let verdict = Block::new("verdict", Content::Verdict(verdict));
    Section::new("result", "Result", [verdict].into_iter().chain(histogram).collect())
}

/// A plot for every check with a margin and every factor.
fn margins(report: &Report<'_>, worst: &[WorstCase]) -> Option<Section> {
    let axes: Vec<_> = (0..report.campaign.file.factors.len()).map(|at| Quantity::of(report, at)).collect();
    let drawn = |check: &String| {
        let margin = |result: &CaseResult| {
            let check = result.checks.iter().find(|found| found.name == *check)?;
            Some(check.relative_margin? * 100.0)
        };
        let has_margin = report.results.iter().any(|result| margin(result).is_some());
        let axes = axes.iter().enumerate().filter(move |_| has_margin);
        let title = format!("Margin of {check}");
        let chart = |(at, axis): (usize, &Quantity)| {
            let dots = series(report, worst, |result| Some((axis.place(result)?, margin(result)?)));
            let fails = Limit { name: "fails below".to_owned(), kind: LevelKind::Limit, values: vec![0.0] };
            let chart = Chart { limits: vec![fails], ..chart(&title, "% of its limit", axis, dots) };
            Block::chart(format!("margin-{check}-{at}"), chart).half()
        };
        axes.map(chart).collect::<Vec<_>>()
    };
    let plots: Vec<_> = check_names(&report.results).iter().flat_map(drawn).collect();
    let about = Block::text(
        "margins-about",
        "A dot is a case. A click opens its report, or its result where no run was recorded.",
    );
    let blocks: Vec<_> = [about].into_iter().chain(plots).collect();
    (blocks.len() > 1).then(|| Section::new("margins", "Margin against each factor", blocks))
}

/// The verdicts over two factors at a time.
fn pairs(report: &Report<'_>, worst: &[WorstCase]) -> Option<Section> {
    let factors = crate::influence::most_influential(report, PAIRED);
    let pairs = factors
        .iter()
        .enumerate()
        .flat_map(|(at, &one)| factors[at + 1..].iter().map(move |&other| [one, other]));
    let plots = pairs.map(|pair| {
        let [across, up] = pair.map(|factor| Quantity::of(report, factor));
        let dots = series(report, worst, |result| Some((across.place(result)?, up.place(result)?)));
        let chart = Chart { scale: up.scale.clone(), ..chart(&up.label, "", &across, dots) };
        Block::chart(format!("pair-{}-{}", pair[0], pair[1]), chart).half()
    });
    let plots: Vec<_> = plots.collect();
    let about = "The factors that move the smallest margin most, two at a time.";
    let blocks: Vec<_> = [Block::text("pairs-about", about)].into_iter().chain(plots).collect();
    (blocks.len() > 1).then(|| Section::new("pairs", "Two factors at a time", blocks))
}

/// Equal reasons are counted. Figures in them differ from case to case, and do not tell reasons apart.
fn reasons(report: &Report<'_>, worst: &[WorstCase]) -> Option<Section> {
    let others = || report.worst(usize::MAX).into_iter().filter(|result| !result.has_passed());
    let kinds = in_order_of_appearance(others().map(kind));
    let mut groups: Vec<Vec<&CaseResult>> =
        kinds.iter().map(|of| others().filter(|result| kind(result) == *of).collect()).collect();
    groups.sort_by_key(|group| std::cmp::Reverse(group.len()));
    let rows = groups.iter().map(|group| {
        let first = group[0];
        [
            mark(first),
            group.len().to_string().into(),
            first.reason.clone().into(),
            Cell::Link { text: format!("case {}", first.number), href: link(first, worst) },
        ]
    });
    let columns =
        [Column::texts(&["verdict"]), Column::numbers(&["cases"]), Column::texts(&["why", "for example"])];
    let table = Table::new("Reasons of the cases that did not pass", columns, rows);
    (!groups.is_empty())
        .then(|| Section::new("reasons", "Why cases did not pass", vec![Block::table("reasons", table)]))
}

/// Verdict and reason of a case without its decimal figures.
fn kind(result: &CaseResult) -> (String, String) {
    let words = result.reason.split(' ').map(|word| {
        if word.contains('.') && word.starts_with(|c: char| c.is_ascii_digit()) { "…" } else { word }
    });
    (result.word.clone(), words.collect::<Vec<_>>().join(" "))
}

/// The report of a case that was recorded, else its result.
fn link(result: &CaseResult, worst: &[WorstCase]) -> String {
    let recorded = worst.iter().find(|kept| kept.number == result.number).and_then(|kept| kept.run.as_ref());
    let name = recorded.and_then(|run| run.file_name());
    name.map_or_else(
        || format!("cases/{}/result.json", result.id),
        |name| format!("worst/{}/report.html", name.to_string_lossy()),
    )
}

fn worst_cases(report: &Report<'_>, worst: &[WorstCase]) -> Option<Section> {
    let rows: Vec<_> = worst
        .iter()
        .filter_map(|kept| {
            let result = report.results.iter().find(|result| result.number == kept.number)?;
            let margin = result.least_margin();
            Some([
                Cell::Link { text: result.number.to_string(), href: link(result, worst) },
                mark(result),
                margin
                    .map_or_else(|| "–".to_owned(), |(name, margin)| format!("{}, {name}", percent(margin)))
                    .into(),
                values(result).into(),
                format!("`{}`", kept.command).into(),
            ])
        })
        .collect();
    let columns = Column::texts(&["case", "verdict", "smallest margin", "factors", "again"]);
    let table = Table::new("Table of the worst cases", [columns], rows.clone());
    (!rows.is_empty()).then(|| Section::new("worst", "Worst cases", vec![Block::table("worst-cases", table)]))
}

fn mark(result: &CaseResult) -> Cell {
    let tone = match (result.has_passed(), result.is_judged()) {
        (true, _) => Tone::Good,
        (false, true) => Tone::Bad,
        (false, false) => Tone::Doubtful,
    };
    Cell::Mark { mark: result.word.clone(), tone }
}

fn values(result: &CaseResult) -> String {
    let value = |setting: &Setting| {
        let number = setting.number().filter(|_| !matches!(setting.value, Some(toml::Value::String(_))));
        let word = number.map_or_else(|| setting.word(), |number| format!("{number:.4}"));
        format!("{} = {word}", setting.name)
    };
    result.settings.iter().map(value).collect::<Vec<_>>().join(", ")
}

/// A factor as an axis.
struct Quantity {
    factor: usize,
    label: String,
    scale: Scale,
}

impl Quantity {
    fn of(report: &Report<'_>, at: usize) -> Self {
        let factor = &report.campaign.file.factors[at];
        let unit = factor.unit();
        let label =
            if unit.is_empty() { factor.name().to_owned() } else { format!("{}, {unit}", factor.name()) };
        let settings = || report.results.iter().filter_map(|result| result.settings.get(at));
        let scale = if settings().any(|setting| setting.number().is_none()) {
            Scale::Names(in_order_of_appearance(settings().map(Setting::word)))
        } else if factor.distribution == Distribution::LogUniform {
            Scale::Log
        } else {
            Scale::Linear
        };
        Self { factor: at, label, scale }
    }

    /// Where a case lies along the axis.
    fn place(&self, result: &CaseResult) -> Option<f64> {
        let setting = result.settings.get(self.factor)?;
        match &self.scale {
            Scale::Names(names) => {
                names.iter().position(|word| *word == setting.word()).map(|place| place as f64)
            }
            Scale::Linear | Scale::Log => setting.number(),
        }
    }
}

fn chart(title: &str, unit: &str, across: &Quantity, series: Vec<Series>) -> Chart {
    let across = Across::Quantity { label: across.label.clone(), scale: across.scale.clone() };
    let otherwise = "No case has such a value.".to_owned();
    Chart { across, series, height: HEIGHT, otherwise, ..Chart::over_time(title, unit) }
}

/// The cases as dots. Those that did not pass are drawn last, above the others.
fn series(
    report: &Report<'_>,
    worst: &[WorstCase],
    place: impl Fn(&CaseResult) -> Option<(f64, f64)>,
) -> Vec<Series> {
    type Belongs = fn(&CaseResult) -> bool;
    let kinds: [(&str, usize, Belongs); 3] = [
        ("passed", 0, CaseResult::has_passed),
        ("not judged", 4, |result| !result.is_judged()),
        ("did not pass", 1, |result| result.is_judged() && !result.has_passed()),
    ];
    let all = kinds.map(|(name, colour, belongs)| {
        let of = report.results.iter().filter(|result| belongs(result));
        let dot = |result: &CaseResult| {
            let margin = result
                .least_margin()
                .map_or_else(String::new, |(_, margin)| format!(", margin {}", percent(margin)));
            let (x, y) = place(result)?;
            Some(Dot {
                at: (digits(x), digits(y)),
                name: format!("case {}, {}{margin}", result.number, result.word),
                link: link(result, worst),
            })
        };
        let mut dots: Vec<_> = of.filter_map(dot).collect();
        dots.sort_by(|a, b| a.at.0.total_cmp(&b.at.0));
        Series::dots(name, dots).coloured(colour)
    });
    all.into_iter().filter(|series| !series.names.is_empty()).collect()
}

/// What a plot shows of a number: six digits.
fn digits(number: f64) -> f64 {
    format!("{number:.5e}").parse().unwrap_or(number)
}
