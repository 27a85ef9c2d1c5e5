//! The search for the values of a campaign's factors with the smallest margin.

use masseter_campaign::{CaseResult, Search, Value};

/// The value of a case that did not pass although no margin shows it: below every one that does.
const STOPPED: f64 = -1.0;

/// What a search came to.
pub(crate) struct Found {
    /// The number of runs until the first margin below zero; none without one.
    pub(crate) first: Option<usize>,
    pub(crate) results: Vec<CaseResult>,
}

/// Searches for a small margin: that of this requirement, or the smallest of all.
pub(crate) fn search(
    search: &Search,
    requirement: Option<&str>,
    player: &super::play::Player,
) -> Result<Found, masseter_terminal::Failure> {
    let (ended, results) = std::sync::mpsc::channel();
    let campaign = &player.campaign;
    let first = search.run(campaign.file.factors.len(), |number, point| {
        let Some(result) = player.result_of(&campaign.case_at(number, point, 0)).transpose() else {
            return Value::End;
        };
        let value = result.as_ref().map_or(Value::End, |result| value(result, requirement));
        ended
            .send(result.map(|result| CaseResult { number, ..result }))
            .expect("the results are taken below");
        value
    });
    drop(ended);
    Ok(Found { first, results: results.into_iter().collect::<Result<_, _>>()? })
}

/// The margin that leads the search: that of the named requirement, or the smallest of all, as a share of its limit.
/// A fault that never struck, or a case that could not run, says nothing.
fn value(result: &CaseResult, requirement: Option<&str>) -> Value {
    if !result.is_judged() {
        return Value::Nothing;
    }
    let stopped = (!result.has_passed()).then_some(STOPPED);
    let margin = match requirement {
        Some(name) => {
            let check = result.checks.iter().find(|check| check.name == name);
            let margin = check.and_then(|check| check.relative_margin);
            // A margin says nothing of a case that failed in another way.
            margin.filter(|margin| result.has_passed() || *margin < 0.0).or(stopped)
        }
        None if !result.has_passed() => {
            Some(result.least_margin().map_or(STOPPED, |(_, margin)| margin.min(STOPPED)))
        }
        None => result.least_margin().map(|(_, margin)| margin),
    };
    margin.map_or(Value::Nothing, Value::Margin)
}

#[cfg(test)]
mod tests {
    use masseter_campaign::{Campaign, Method};
    use masseter_controller::motion_controller::MotionController;
    use masseter_controller::pose_law::{Demand, LawFailed, PoseLaw};
    use masseter_model::geometry::{Pose, Vec3};
    use masseter_scenario::Scenario;
    use masseter_terminal::status;

    use super::*;
    use crate::run::runner::{Judged, Runner, Source};

    const SCENARIO: &str = "\
duration_s = 0.6
[controller]
tracking_limit_m = 1e-3
tracking_rms_limit_m = 1e-3
[can]
following_limit_m = 5e-4
[[require]]
name = 'incisal'
signal = 'incisal.error'
during = 'running'
max = '200 um'
";
    const CAMPAIGN: &str = "\
[[factor]]
key = 'dynamics.slide_friction_n'
range = [1.0, 5.0]
[[factor]]
key = 'dynamics.viscous_friction_n_s_per_m'
range = [0.0, 10.0]
[[factor]]
key = 'dynamics.platform_mass_kg'
range = [0.2, 1.0]
[[factor]]
key = 'motion.cycle_rate_hz'
range = [0.5, 1.0]
";
    /// The corner in which the controller fails: its middle and half its width, as shares of each range.
    const CORNER: [f64; 2] = [0.85, 0.1];

    /// Growth of the law's error towards the corner, per share of the ranges.
    const STEEPNESS: f64 = 5.0;

    /// Cycles in which the law goes aside: a jump would be a safe stop.
    const EASED: u32 = 100;

    /// The law follows the desired pose, but beside it by 0.33 mm in the middle of the corner, and by less further
    /// away.
    #[derive(Debug)]
    struct WeakInACorner {
        beside_m: Vec3,
        cycles: u32,
    }

    impl WeakInACorner {
        fn new(scenario: &Scenario) -> Self {
            let masseter_scenario::MotionConfig::Chewing(chewing) = &scenario.motion else {
                panic!("the campaign has one motion")
            };
            let dynamics = &scenario.dynamics;
            let shares = [
                (dynamics.slide_friction_n - 1.0) / 4.0,
                dynamics.viscous_friction_n_s_per_m / 10.0,
                (dynamics.platform_mass_kg - 0.2) / 0.8,
                (chewing.cycle_rate_hz - 0.5) / 0.5,
            ];
            let [middle, half] = CORNER;
            let distance = shares.iter().map(|share| (share - middle).abs()).fold(0.0, f64::max);
            // On the border of the corner the error is the limit. The slope there is steep: the law's own error of some µm
            // would widen a flat corner.
            let beside_mm = 0.2 * (STEEPNESS * (half - distance)).exp();
            Self { beside_m: Vec3::new(0.0, 0.0, beside_mm * 1e-3), cycles: 0 }
        }
    }

    impl PoseLaw for WeakInACorner {
        fn command(&mut self, demand: &Demand) -> Result<Pose, LawFailed> {
            self.cycles = (self.cycles + 1).min(EASED);
            let share = 0.5 - 0.5 * (std::f64::consts::PI * f64::from(self.cycles) / f64::from(EASED)).cos();
            let mut pose = demand.ahead;
            pose.translation.vector += share * self.beside_m;
            Ok(pose)
        }
    }

    /// The runs until a margin below zero.
    fn runs_until_found(method: Method, seed: u64, campaign: &Campaign) -> usize {
        let runner = Runner::default();
        let search = Search { method, runs: 5000, seed, go_on: false };
        let evaluate = |number: usize, point: &[f64]| {
            let case = campaign.case_at(number, point, 0);
            let scenario = case.scenario.as_ref().expect("every point is a scenario");
            let played = runner.play_by(
                |scenario, mechanism, motion| {
                    let law = Box::new(WeakInACorner::new(scenario));
                    Box::new(MotionController::with_law(scenario, mechanism, motion, law))
                },
                Source::Scenario(scenario),
            );
            let Judged { verdict, figures } =
                played.map_err(|failure| failure.error).expect("every point can be played");
            value(&CaseResult::new(&case, &verdict, &figures, 0.0), Some("incisal"))
        };
        search.run(4, evaluate).expect("the corner is found")
    }

    #[test]
    fn a_case_that_fails_in_another_way_is_worse_than_every_margin() {
        let stopped = "[[faults]]\nkind = 'drive_fault'\naxis = 'l1'\nat_s = 0.3\n";
        let idle = "[[faults]]\nkind = 'drive_fault'\naxis = 'l1'\nat_s = 9.0\n";
        let value_of = |more: &str, requirement| {
            let base = Scenario::parse("base.toml".as_ref(), &format!("{SCENARIO}{more}")).unwrap();
            let campaign = Campaign {
                file: toml::from_str(CAMPAIGN).unwrap(),
                controller: "motion".to_owned(),
                program: "test".to_owned(),
                folder: "/".into(),
                base: base.to_toml(),
            };
            let case = campaign.case_at(0, &[0.5; 4], 0);
            let scenario = case.scenario.as_ref().expect("the point is a scenario");
            let played = Runner::default().play(Source::Scenario(scenario));
            let Judged { verdict, figures } =
                played.map_err(|failure| failure.error).expect("it can be played");
            value(&CaseResult::new(&case, &verdict, &figures, 0.0), requirement)
        };
        for requirement in [Some("incisal"), None] {
            assert!(matches!(value_of("", requirement), Value::Margin(margin) if margin > 0.0));
            assert!(matches!(value_of(stopped, requirement), Value::Margin(margin) if margin <= STOPPED));
            assert!(matches!(value_of(idle, requirement), Value::Nothing));
        }
    }

    #[test]
    #[ignore = "plays thousands of runs: docs/campaigns.md has the command"]
    fn a_weakness_in_a_corner_of_four_factors_is_found_in_a_fifth_of_the_random_runs() {
        let base = Scenario::parse("weak.toml".as_ref(), SCENARIO).unwrap();
        let campaign = Campaign {
            file: toml::from_str(CAMPAIGN).unwrap(),
            controller: "weak".to_owned(),
            program: "test".to_owned(),
            folder: "/".into(),
            base: base.to_toml(),
        };
        let median = |method| {
            let mut runs: Vec<_> = (1..=20).map(|seed| runs_until_found(method, seed, &campaign)).collect();
            runs.sort_unstable();
            runs[runs.len() / 2]
        };
        let [by_covariance, at_random] = [Method::CmaEs, Method::Random].map(median);
        status!("median of 20 seeds: CMA-ES {by_covariance} runs, random {at_random} runs");
        assert!(by_covariance * 5 <= at_random, "{by_covariance} against {at_random}");
    }
}
