//! A pose controller: an integral of the position error is added to the desired pose.

use std::process::ExitCode;

use masseter_controller::pose_law::{Demand, LawFailed, PoseLaw};
use masseter_controller::process::run_with_law;
use masseter_shared::geometry::{Pose, Vec3};
use masseter_shared::lifecycle::attach::attach;

/// Integral gain, 1/s.
const GAIN_PER_S: f64 = 5.0;
/// The most that is added, m.
const LIMIT_M: f64 = 1e-3;

#[derive(Debug, Default)]
struct IntegralLaw {
    trim_m: Vec3,
}

impl PoseLaw for IntegralLaw {
    fn command(&mut self, demand: &Demand) -> Result<Pose, LawFailed> {
        if let Some(estimated) = &demand.estimated {
            let error_m = demand.desired.translation.vector - estimated.translation.vector;
            self.trim_m += error_m * (GAIN_PER_S * demand.period_s);
            let length_m = self.trim_m.dot(&self.trim_m).sqrt();
            if length_m > LIMIT_M {
                self.trim_m *= LIMIT_M / length_m;
            }
        }
        let mut pose = demand.ahead;
        pose.translation.vector += self.trim_m;
        Ok(pose)
    }
}

fn main() -> ExitCode {
    let context = match attach(None) {
        Ok(context) => context,
        Err(error) => return failed(&error),
    };
    match run_with_law(context, Box::new(IntegralLaw::default())) {
        Ok(_) => ExitCode::SUCCESS,
        Err(error) => failed(&error),
    }
}

fn failed(error: &dyn std::error::Error) -> ExitCode {
    eprintln!("my_controller: {error}");
    ExitCode::FAILURE
}
