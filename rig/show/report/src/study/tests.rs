//! Made-up persons whose differences are known.

use masseter_judge::{COURSE_POINTS, CoursePoint, JawCycleGroup, JawCycleKind, Quantity};

use super::*;

fn recorded(person: &str, condition: &str, opening_mm: f64) -> Recorded {
    let values = [opening_mm - 0.2, opening_mm, opening_mm + 0.2];
    let statistic = Statistic::of(&values);
    let point = |opening_mm| CoursePoint { opening_mm, ..CoursePoint::default() };
    let group = JawCycleGroup {
        name: "chew left".to_owned(),
        kind: JawCycleKind::Chew,
        side: None,
        count: 3,
        quantities: vec![Quantity {
            of: CycleQuantity { name: "opening_mm", about: "opening", unit: "mm" },
            statistic,
        }],
        courses: Vec::new(),
        mean_course: vec![[point(opening_mm), point(0.2)]; COURSE_POINTS],
    };
    let jaw = JawCycleFigures { count: 3, groups: vec![group], ..JawCycleFigures::default() };
    let path_mm = vec![[0.0; 3], [-5.0, 4.0, -opening_mm]];
    let (person, condition) = (person.to_owned(), condition.to_owned());
    Recorded { person, condition, verdict: "PASS".to_owned(), is_true: true, jaw, path_mm }
}

/// Differences of −3.0, −2.5 and −3.5 mm.
fn study() -> Study {
    let openings = [("P1", [18.0, 15.0]), ("P2", [20.0, 17.5]), ("P3", [16.0, 12.5])];
    let recordings = openings.into_iter().flat_map(|(person, [before, after])| {
        [recorded(person, "before", before), recorded(person, "after", after)]
    });
    Study { recordings: recordings.collect(), by: By::parse("patient,session").unwrap() }
}

#[test]
fn a_difference_is_that_within_persons_with_its_interval() {
    let [difference] = &study().differences()[..] else { panic!("one quantity, two conditions") };
    assert_eq!((difference.from.as_str(), difference.to.as_str()), ("before", "after"));
    let Statistic { count, mean, sd, mean_low, mean_high, .. } = difference.statistic;
    assert_eq!((count, mean, sd), (3, Some(-3.0), Some(0.5)));
    // 4.303 · 0.5 / √3 on both sides.
    assert!((mean_low.unwrap() + 4.242).abs() < 1e-3 && (mean_high.unwrap() + 1.758).abs() < 1e-3);
    // −6, corrected by 1 − 3/7.
    assert!((difference.effect.unwrap() + 6.0 * 4.0 / 7.0).abs() < 1e-9);
}

#[test]
fn persons_with_one_condition_make_no_pair_and_repeated_recordings_one_value() {
    let mut study = study();
    study.recordings.push(recorded("P4", "before", 30.0));
    study.recordings.push(recorded("P1", "after", 16.0));
    let [difference] = &study.differences()[..] else { panic!("one quantity, two conditions") };
    // P1's mean after is 15.5 mm.
    assert_eq!(difference.statistic.count, 3);
    assert!((difference.statistic.mean.unwrap() - (-2.5 - 2.5 - 3.5) / 3.0).abs() < 1e-9);
}

#[test]
fn persons_without_a_pseudonym_are_never_taken_for_one() {
    let mut recordings = ["", "run", "", ""].map(|person| recorded(person, "before", 18.0));
    name_persons(&mut recordings, &["run", "any", "day", "day"].map(str::to_owned));
    assert_eq!(recordings.map(|recorded| recorded.person), ["run (1)", "run", "day", "day (4)"]);
}

#[test]
fn a_run_that_is_named_twice_is_refused() {
    let runs = tempfile::tempdir().unwrap();
    let [run, link] = ["run", "latest"].map(|name| runs.path().join(name));
    std::fs::create_dir(&run).unwrap();
    std::fs::write(run.join("recording.mcap"), "").unwrap();
    std::os::unix::fs::symlink(&run, &link).unwrap();
    let refusal = Study::read(&[run, link], By::parse("patient,session").unwrap(), &[]).unwrap_err();
    let refusal = format!("{refusal:#}");
    assert!(
        refusal.contains("latest: it is the same run as") && refusal.contains("name each run once"),
        "{refusal}"
    );
}

#[test]
fn a_key_without_a_value_gives_no_condition() {
    let scenario = Scenario::default();
    assert_eq!(value_of(&scenario, "patient").unwrap(), None);
    assert_eq!(value_of(&scenario, "rate_hz").unwrap(), Some(scenario.rate_hz.to_string()));
    assert!(value_of(&scenario, "no.key").is_err());
}

#[test]
fn one_course_has_no_standard_deviation() {
    let mut study = study();
    let group = &mut study.recordings[0].jaw.groups[0];
    group.courses = vec![(1, [CoursePoint::default(); COURSE_POINTS])];
    let group = &mut study.recordings[1].jaw.groups[0];
    group.courses = vec![(1, [CoursePoint::default(); COURSE_POINTS]); 2];
    let mut text = Vec::new();
    let file = tempfile::NamedTempFile::new().unwrap();
    masseter_table::write_table(
        &masseter_table::Format::Csv,
        file.reopen().unwrap(),
        &output::courses(&study),
    )
    .unwrap();
    std::io::Read::read_to_end(&mut file.reopen().unwrap(), &mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    assert!(text.contains("before,1,chew left,0,18,,0,\n"), "{text}");
    assert!(text.contains("after,2,chew left,0,15,0.2,0,0\n"), "{text}");
}

#[test]
fn a_figure_is_as_wide_as_a_column_and_shows_each_condition() {
    let figures = figures::figures(&study());
    let names: Vec<_> = figures.iter().map(|figure| figure.name.as_str()).collect();
    assert_eq!(
        names,
        ["cycles-chew-left-85mm.svg", "cycles-chew-left-170mm.svg", "paths-85mm.svg", "paths-170mm.svg"]
    );
    for (figure, width) in figures.iter().zip(["85mm", "170mm", "85mm", "170mm"]) {
        assert!(figure.svg.contains(&format!("width=\"{width}\"")), "{}", figure.svg);
        assert!(["before", "after"].iter().all(|condition| figure.svg.contains(condition)));
    }
}

#[test]
fn the_page_draws_each_condition_for_the_screen_beside_the_figures_for_print() {
    let study = study();
    let html = page::html(&study, &study.differences(), figures::figures(&study), "made up").unwrap();
    assert!(html.contains("after, mean + SD") && html.contains("\"kind\":\"figure\""), "{html}");
}
