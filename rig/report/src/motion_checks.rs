//! Whether the platform followed its path: its errors while the motion played, and where each fault led it.

use masseter_analysis::{FaultFigures, PoseErrors};
use masseter_scenario::wording::counted;
use masseter_scenario::{ChecksConfig, FaultConfig};

use crate::check::{Check, CheckResult};

/// The name of the check of the declared faults.
pub(crate) const FAULTS: &str = "faults";

/// Fewer samples of a motion show nothing.
const FEWEST_SAMPLES: u64 = 10;

/// What is no number is within no limit.
fn is_within(value: f64, limit: f64) -> bool {
    value <= limit
}

/// Whether the jaw left its path by more than the limits for a moment, before a safe stop or without one.
pub(crate) fn left_its_path(errors: &PoseErrors, limits: &ChecksConfig) -> bool {
    let ChecksConfig { tracking_max_mm, tracking_max_deg, .. } = *limits;
    let peaks = [
        (errors.incisal_max_mm, tracking_max_mm),
        (errors.max_mm, tracking_max_mm),
        (errors.max_deg, tracking_max_deg),
    ];
    peaks.into_iter().any(|(value, limit)| value.is_some_and(|value| !is_within(value, limit)))
}

/// The worst error against its limit, or all that exceed theirs; untested if the motion left too little to compare.
pub(crate) fn tracking(
    name: &'static str,
    samples: u64,
    errors: &PoseErrors,
    limits: &ChecksConfig,
) -> Check {
    let ChecksConfig { tracking_rms_mm, tracking_max_mm, tracking_rms_deg, tracking_max_deg, .. } = *limits;
    let figures = [
        ("incisal point rms", errors.incisal_rms_mm, tracking_rms_mm, " mm"),
        ("incisal point max", errors.incisal_max_mm, tracking_max_mm, " mm"),
        ("platform rms", errors.rms_mm, tracking_rms_mm, " mm"),
        ("platform max", errors.max_mm, tracking_max_mm, " mm"),
        ("platform rms", errors.rms_deg, tracking_rms_deg, "°"),
        ("platform max", errors.max_deg, tracking_max_deg, "°"),
    ];
    let mut found: Vec<_> = figures
        .into_iter()
        .filter_map(|(what, value, limit, unit)| {
            let value = value?;
            Some((value, limit, format!("{what} {value:.4}{unit}, limit {limit}{unit}")))
        })
        .collect();
    found.sort_by(|(a, of_a, _), (b, of_b, _)| (b / of_b).total_cmp(&(a / of_a)));
    let exceeding: Vec<_> = found
        .iter()
        .filter(|(value, limit, _)| !is_within(*value, *limit))
        .map(|(_, _, text)| text.as_str())
        .collect();
    match found.first() {
        _ if !exceeding.is_empty() => Check::judged(name, exceeding.join("; "), false),
        Some((_, _, closest)) if samples >= FEWEST_SAMPLES => {
            Check::judged(name, format!("closest of {samples} samples: {closest}"), true)
        }
        _ => {
            let samples = counted(samples, "sample");
            let why =
                format!("{samples} to compare, at least {FEWEST_SAMPLES} needed: play more of the motion");
            Check::untested(name, why)
        }
    }
}

/// A test with faults that passes without them has tested nothing, and a fault that leads the jaw beyond the limits must be
/// detected before. None where no fault is declared.
pub(crate) fn faults(
    declared: &[FaultConfig],
    found: &[FaultFigures],
    limits: &ChecksConfig,
) -> Option<Check> {
    let ChecksConfig { tracking_max_mm, tracking_max_deg, .. } = *limits;
    let idle: Vec<_> = found
        .iter()
        .filter(|fault| fault.struck_ns.is_none())
        .map(|fault| fault.number.to_string())
        .collect();
    let beyond: Vec<_> = declared
        .iter()
        .zip(found)
        .filter(|(_, found)| {
            !is_within(found.deviation_mm, tracking_max_mm) || !is_within(found.deviation_deg, tracking_max_deg)
        })
        .map(|(fault, FaultFigures { number, deviation_mm, deviation_deg, detection, .. })| {
            let until = if detection.is_some() { "before it was detected" } else { "undetected" };
            format!(
                "; number {number}, {fault}, led {deviation_mm:.3} mm and {deviation_deg:.3}° from the path {until}, limit \
                 {tracking_max_mm} mm and {tracking_max_deg}°"
            )
        })
        .collect();
    let which = match idle.as_slice() {
        [] => String::new(),
        idle => format!(
            ", number {} never: raise its probability, or let the fault act earlier or longer",
            idle.join(", ")
        ),
    };
    let struck =
        format!("{} of {} declared faults acted{which}", declared.len() - idle.len(), declared.len());
    let result = match (beyond.is_empty(), idle.is_empty()) {
        (true, true) => CheckResult::Passed,
        (true, false) => CheckResult::Untested,
        (false, _) => CheckResult::Failed,
    };
    (!declared.is_empty()).then(|| Check::new(FAULTS, struck + &beyond.concat(), result))
}

#[cfg(test)]
mod tests {
    use masseter_scenario::FaultKindConfig;

    use super::*;

    type Spoil = fn(&mut PoseErrors, Option<f64>);

    #[test]
    fn every_error_has_its_own_limit_and_the_closest_is_shown() {
        let limits = ChecksConfig::default();
        let good = PoseErrors {
            rms_mm: Some(0.01),
            max_mm: Some(0.02),
            incisal_rms_mm: Some(0.01),
            incisal_max_mm: Some(0.1),
            rms_deg: Some(0.01),
            max_deg: Some(0.02),
        };
        let check = tracking("tracking", 10, &good, &limits);
        assert_eq!(
            (check.result.mark(), check.finding.as_str()),
            ("ok", "closest of 10 samples: incisal point max 0.1000 mm, limit 0.5 mm")
        );
        let rms_is_closest = PoseErrors { rms_mm: Some(0.05), incisal_max_mm: Some(0.2), ..good };
        let check = tracking("tracking", 10, &rms_is_closest, &limits);
        assert_eq!(check.finding, "closest of 10 samples: platform rms 0.0500 mm, limit 0.1 mm");
        let mm = |share: f64, limit: f64| Some(share * limit);
        let each: [(Spoil, f64); 6] = [
            (|errors, value| errors.rms_mm = value, limits.tracking_rms_mm),
            (|errors, value| errors.max_mm = value, limits.tracking_max_mm),
            (|errors, value| errors.incisal_rms_mm = value, limits.tracking_rms_mm),
            (|errors, value| errors.incisal_max_mm = value, limits.tracking_max_mm),
            (|errors, value| errors.rms_deg = value, limits.tracking_rms_deg),
            (|errors, value| errors.max_deg = value, limits.tracking_max_deg),
        ];
        for (spoil, limit) in each {
            for (share, mark) in [
                (0.99, "ok"),
                (1.0, "ok"),
                (1.01, "FAIL"),
                (f64::INFINITY, "FAIL"),
                (f64::NAN, "FAIL"),
                (-f64::NAN, "FAIL"),
            ] {
                let mut errors = good;
                spoil(&mut errors, mm(share, limit));
                for samples in [10, 1, 0] {
                    let check = tracking("tracking", samples, &errors, &limits);
                    let expected = if mark == "ok" && samples < 10 { "UNTESTED" } else { mark };
                    assert_eq!(check.result.mark(), expected, "{check:?}");
                }
            }
        }
    }

    #[test]
    fn a_motion_that_hardly_began_is_untested() {
        let still = PoseErrors::default();
        let eased = PoseErrors { max_mm: Some(0.02), ..still };
        let begun = PoseErrors { rms_mm: Some(0.01), ..eased };
        let cases = [
            (0, still, "UNTESTED", "0 samples to compare, at least 10 needed: play more of the motion"),
            (0, eased, "UNTESTED", "0 samples to compare, at least 10 needed: play more of the motion"),
            (9, begun, "UNTESTED", "9 samples to compare, at least 10 needed: play more of the motion"),
            (10, begun, "ok", "closest of 10 samples: platform rms 0.0100 mm, limit 0.1 mm"),
        ];
        for (samples, errors, mark, finding) in cases {
            let check = tracking("tracking", samples, &errors, &ChecksConfig::default());
            assert_eq!((check.result.mark(), check.finding.as_str()), (mark, finding));
        }
    }

    fn fault() -> FaultConfig {
        FaultConfig {
            bus: Some(1),
            from_s: Some(2.5),
            node: Some(4),
            id: Some(0x204),
            ..FaultConfig::new(FaultKindConfig::Lose)
        }
    }

    fn figures(number: usize, struck_ns: Option<u64>, deviation_mm: f64) -> FaultFigures {
        FaultFigures { number, struck_ns, deviation_mm, deviation_deg: 0.1, detection: None }
    }

    #[test]
    fn a_declared_fault_that_never_acted_tested_nothing() {
        let what_to_do = ": raise its probability, or let the fault act earlier or longer";
        let cases = [
            (0, None),
            (1, Some(("ok", "1 of 1 declared faults acted".to_owned()))),
            (2, Some(("UNTESTED", format!("1 of 2 declared faults acted, number 2 never{what_to_do}")))),
            (3, Some(("UNTESTED", format!("1 of 3 declared faults acted, number 2, 3 never{what_to_do}")))),
        ];
        for (declared, expected) in cases {
            let found: Vec<_> =
                (1..=declared).map(|number| figures(number, (number == 1).then_some(5), 0.0)).collect();
            let check = faults(&vec![fault(); declared], &found, &ChecksConfig::default());
            assert_eq!(check.map(|check| (check.result.mark(), check.finding)), expected);
        }
        let found = [figures(1, None, 0.0), figures(2, Some(5), 0.6)];
        let check = faults(&[fault(), fault()], &found, &ChecksConfig::default()).unwrap();
        assert_eq!(check.result.mark(), "FAIL", "one fault led the jaw too far: {check:?}");
    }

    #[test]
    fn a_fault_that_leads_the_jaw_beyond_the_limit_fails_the_run_with_its_name() {
        for (deviation_mm, mark) in [(0.5, "ok"), (0.51, "FAIL")] {
            let found = [figures(1, Some(5), deviation_mm)];
            let check = faults(&[fault()], &found, &ChecksConfig::default()).unwrap();
            assert_eq!(check.result.mark(), mark, "{check:?}");
            let named = "number 1, lose (bus 1, node 4, id 204h), led 0.510 mm and 0.100° from the path undetected, \
                         limit 0.5 mm and 0.5°";
            assert_eq!(check.finding.contains(named), mark == "FAIL", "{check:?}");
        }
        let turned = FaultFigures { deviation_deg: 0.5, ..figures(1, Some(5), 0.1) };
        let check = faults(&[fault()], &[turned], &ChecksConfig::default()).unwrap();
        assert_eq!(check.result.mark(), "ok", "{check:?}");
        for deviation_deg in [0.51, f64::INFINITY, f64::NAN] {
            let turned = FaultFigures { deviation_deg, ..figures(1, Some(5), 0.1) };
            let shifted = FaultFigures { deviation_mm: deviation_deg, ..figures(1, Some(5), 0.1) };
            for found in [turned, shifted] {
                let check = faults(&[fault()], &[found], &ChecksConfig::default()).unwrap();
                assert_eq!(check.result.mark(), "FAIL", "{check:?}");
            }
        }
    }
}
