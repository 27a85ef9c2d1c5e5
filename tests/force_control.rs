//! The bite force of whole runs: its estimate against the truth, its control, and what happens when food breaks.

mod common;

use common::{Workspace, check, stderr, stdout};

/// Errors of the estimate while the jaw chews, as bounds that only serve to report the values.
const ESTIMATE: &str = "
duration_s = 5.0
[food]
[force_estimate]
[[require]]
name = 'rms'
expression = '{signal.bite_force_n} - {bite.force}'
unit = 'N'
during = 'bite.force > 1 N'
statistic = 'rms'
max = '100 N'
[[require]]
name = 'beyond'
expression = 'abs({signal.bite_force_n} - {bite.force}) - {signal.bite_force_uncertainty_n}'
unit = 'N'
during = 'running'
statistic = 'percentile'
percentile = 90
max = '100 N'
";

/// The value that a requirement of at most 100 has found.
fn found(scenario: &str, names: &[&str]) -> Vec<f64> {
    let workspace = Workspace::new(scenario);
    let output = workspace.run_virtual(&[]);
    assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
    let summary = workspace.summary();
    let value = |name: &&str| 100.0 - check(&summary, name)["margin"].as_f64().unwrap();
    names.iter().map(value).collect()
}

#[test]
fn with_known_friction_the_estimate_is_within_a_newton_and_its_uncertainty_covers_the_error() {
    let [rms_n, beyond_n] = found(ESTIMATE, &["rms", "beyond"])[..] else { panic!() };
    assert!(rms_n < 1.0, "{rms_n}");
    assert!(beyond_n <= 0.0, "{beyond_n}");
}

#[test]
fn friction_that_is_wrong_by_a_third_shifts_the_estimate_by_a_part_of_the_friction() {
    let wrong =
        format!("{ESTIMATE}\n[controller.model]\nslide_friction_n = 5.6\nviscous_friction_n_s_per_m = 14.0");
    let [rms_n] = found(&wrong, &["rms"])[..] else { panic!() };
    // Three legs of 2 N and 20 N s/m · 60 mm/s, 30 % off.
    assert!((0.5..4.0).contains(&rms_n), "{rms_n}");
}
