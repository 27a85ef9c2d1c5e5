//! A pose controller: an integral of the position error is added to the desired pose.

use std::process::ExitCode;

use masseter_controller::pose_law::{Demand, LawFailed, PoseLaw};
use masseter_controller::process::{ControllerError, run_with_law};
use masseter_model::geometry::{Pose, Vec3};
use masseter_runtime::lifecycle::attach::attach;
use masseter_runtime::named::{Declared, Parameter, Signal};

const LIMIT_M: f64 = 1e-3; // the most that is added

#[derive(Debug, Default)]
struct IntegralLaw {
    gain_per_s: f64,
    trim_m: Vec3,
    trim_mm: f64,
}

impl PoseLaw for IntegralLaw {
    fn command(&mut self, demand: &Demand) -> Result<Pose, LawFailed> {
        if let Some(estimated) = &demand.estimated {
            let error_m = demand.desired.translation.vector - estimated.translation.vector;
            self.trim_m += error_m * (self.gain_per_s * demand.period_s);
            let length_m = self.trim_m.dot(&self.trim_m).sqrt();
            if length_m > LIMIT_M {
                self.trim_m *= LIMIT_M / length_m;
            }
            self.trim_mm = 1e3 * length_m;
        }
        let mut pose = demand.ahead;
        pose.translation.vector += self.trim_m;
        Ok(pose)
    }

    fn declared(&self) -> Declared {
        let gain = Parameter { unit: "1/s".into(), range: [0.0, 100.0], ..Parameter::new("gain", 5.0) };
        let about = "Length of the correction.".into();
        let trim = Signal { name: "trim".into(), unit: "mm".into(), about };
        Declared { signals: vec![trim], parameters: vec![gain], ..Declared::default() }
    }

    fn set_parameter(&mut self, _place: usize, value: f64) {
        self.gain_per_s = value;
    }

    fn fill_signals(&self, signals: &mut [f64]) {
        signals[0] = self.trim_mm;
    }
}

fn main() -> ExitCode {
    let attached = attach(None).map_err(ControllerError::from);
    let ran = attached.and_then(|context| run_with_law(context, Box::new(IntegralLaw::default())));
    let report = |error| eprintln!("my_controller: {error}");
    ran.map_err(report).map_or(ExitCode::FAILURE, |_| ExitCode::SUCCESS)
}
