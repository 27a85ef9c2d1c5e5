use masseter_model::geometry::Deviation;

use super::*;

fn of(check: &'static str, breach: Breach) -> Breach {
    breach.of(check.into())
}

#[test]
fn the_earliest_breach_is_named_with_value_limit_and_time_of_the_motion() {
    let breach =
        |check, at_ns: Option<u64>| of(check, Breach::new("incisal.z", "12.5 mm", "12 mm").at(at_ns));
    let breaches = [
        breach("without a time", None),
        breach("late", Some(3_000_000_000)),
        breach("early", Some(2_250_000_000)),
    ];
    let first = |breaches: &[Breach]| {
        earliest(breaches.iter().cloned(), Some(1_000_000_000)).map(|found| found.to_string())
    };
    let early = "early: incisal.z 12.5 mm, limit 12 mm, at 1.250 s of the motion";
    assert_eq!(first(&breaches).as_deref(), Some(early));
    assert_eq!(first(&breaches[..1]).as_deref(), Some("without a time: incisal.z 12.5 mm, limit 12 mm"));
    assert_eq!(first(&[]), None);
}

#[test]
fn what_shows_in_a_stretch_of_time_counts_from_its_end() {
    let rms = Breach::new("rms", "2 mm", "1 mm").over(Some([1_000_000_000, 5_000_000_000]));
    let whole = of("whole", rms);
    let moment = of("moment", Breach::new("z", "3", "2").at(4_000_000_000));
    let first = |breaches: &[Breach]| earliest(breaches.iter().cloned(), Some(1_000_000_000)).unwrap();
    assert_eq!(first(&[whole.clone(), moment]).check, "moment");
    let words = "whole: rms 2 mm, limit 1 mm, from 0.000 s to 4.000 s of the motion";
    assert_eq!(first(&[whole]).to_string(), words);
}

#[test]
fn the_first_error_beyond_its_limit_counts_and_not_the_largest() {
    let limits = ChecksConfig { tracking_max_mm: 0.5, tracking_max_deg: 1.0, ..ChecksConfig::default() };
    let sample = |ms: u64, incisal_mm: f64| {
        let deviation = Deviation { incisal_m: incisal_mm / 1e3, angle_rad: 0.0, origin_m: 0.0 };
        PathSample { sampled_ns: ms * 1_000_000, desired: None, actual: None, deviation }
    };
    let found = |errors_mm: &[f64]| {
        let mut found = PathBreach::default();
        for (ms, error_mm) in (10..).zip(errors_mm) {
            found.take(&sample(ms, *error_mm), ms > 10, &limits);
        }
        found
    };
    let breach = Breach::new("incisal point from its path", "0.6000 mm", "0.5 mm").at(12_000_000);
    assert_eq!(found(&[0.1, 0.5, 0.6, 2.0]).first, Some(breach));
    assert_eq!(found(&[0.1, 0.5]), PathBreach { motion_ns: Some([11_000_000; 2]), first: None });
    assert!(found(&[f64::NAN]).first.is_some(), "what is no number is beyond every limit");
    for (origin_m, angle_rad, is_beyond) in
        [(6e-4, 0.0, true), (0.0, 0.02, true), (0.0, f64::NAN, true), (4e-4, 0.01, false)]
    {
        let mut found = PathBreach::default();
        let deviation = Deviation { incisal_m: 0.0, angle_rad, origin_m };
        found.take(&PathSample { deviation, ..sample(10, 0.0) }, true, &limits);
        assert_eq!(found.first.is_some(), is_beyond, "{origin_m} m, {angle_rad} rad");
    }
}
