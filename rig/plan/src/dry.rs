//! The scenario of a dry run.

use masseter_scenario::Scenario;

/// Makes a scenario that of its dry run; one that is a dry run already stays as it is.
pub(crate) fn enter_dry_run(scenario: &mut Scenario) {
    if std::mem::replace(&mut scenario.dry.is_on, true) {
        return;
    }
    let margin_m = scenario.dry.stroke_margin_mm * 1e-3;
    let strokes = &mut scenario.mechanism.strokes;
    for [low_m, high_m] in [&mut strokes.slide_m, &mut strokes.leg_m] {
        (*low_m, *high_m) = (*low_m + margin_m, *high_m - margin_m);
    }
    scenario.controller.ease_s /= scenario.dry.speed;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dry_run_keeps_from_the_ends_and_is_entered_once() {
        let normal = Scenario::default();
        let mut dry = normal.clone();
        (0..2).for_each(|_| enter_dry_run(&mut dry));
        let ends =
            |scenario: &Scenario| [scenario.mechanism.strokes.slide_m, scenario.mechanism.strokes.leg_m];
        for ([low_m, high_m], [dry_low_m, dry_high_m]) in ends(&normal).into_iter().zip(ends(&dry)) {
            assert!((dry_low_m - low_m - 1e-3).abs() < 1e-12 && (high_m - dry_high_m - 1e-3).abs() < 1e-12);
        }
        assert!((dry.controller.ease_s - 10.0).abs() < 1e-12);
        assert_eq!((dry.dry.speed_now(), dry.dry.force_now()), (0.1, 0.3));
        assert_eq!((normal.dry.speed_now(), normal.dry.force_now()), (1.0, 1.0));
        dry.validate().unwrap();
    }
}
