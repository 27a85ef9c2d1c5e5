//! A step that moves or reads the drives, from the claimed interfaces to its evidence and exit code.

use anyhow::{Context, anyhow};
use masseter_can::canopen::ObjectAddress;
use masseter_plant::bringup::{Line, MotionError, StopCause};
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::Scenario;
use masseter_shared::geometry::AXES;
use masseter_shared::lifecycle::StopRequest;
use masseter_terminal::{Exit, Failure, OrFailure, status};
use serde::Serialize;
use serde_json::json;

use super::args::RobotArgs;
use super::evidence::{Basis, StepFolder};
use super::ledger::{self, Files};
use super::past::Past;
use super::robot_line::failed;
use super::step::Step;

/// How long the step listens for other masters, ns.
const LISTEN_NS: u64 = 500 * MILLISECOND_NS;

/// A step under way.
pub(super) struct Session {
    pub(super) scenario: Scenario,
    pub(super) line: Line,
    pub(super) stop: StopRequest,
    folder: StepFolder,
}

impl Session {
    /// Claims the interfaces, makes the folder, and refuses without the evidence of an earlier step for these axes.
    pub(super) fn begin(
        args: &RobotArgs,
        step: Step,
        axes: &[usize],
        earlier: impl Fn(usize) -> Option<Step>,
    ) -> Result<Self, Failure> {
        let scenario = args.scenario().usage()?;
        let stop = StopRequest::listen_alone().context("cannot listen for signals").died()?;
        let past = Past::read(&args.folder).usage()?;
        let require = |basis: &Basis| {
            let mut needed = axes.iter().filter_map(|&axis| Some((earlier(axis)?, axis)));
            needed.try_for_each(|(earlier, axis)| past.require(earlier, &[axis], basis))
        };
        // A refused step makes no folder: it would replace the evidence of the same step from before.
        require(&Basis::new(&scenario, [None; AXES])).usage()?;
        let mut folder = StepFolder::begin(&args.folder, step, axes, &scenario).usage()?;
        if axes.iter().any(|&axis| earlier(axis).is_none()) {
            folder.note_out_of_order();
        }
        let log = folder.log().context("cannot write the log of the buses").incomplete()?;
        let mut line = Line::open(&scenario, log).usage()?;
        line.listen(LISTEN_NS).died()?;
        if let Some((bus, sign)) = line.strangers().masters.first() {
            let other = anyhow!("bus {bus}: another master sends {sign}; end that program first");
            return Err(Failure::with(Exit::Usage, other));
        }
        let serials = serials(&mut line);
        folder.note_serials(serials);
        require(&folder.basis()).usage()?;
        ledger::settle(&args.folder, &scenario, &mut line).map_err(failed)?;
        line.keep_old_values_in(Box::new(Files::new(&args.folder, serials)));
        Ok(Self { scenario, line, stop, folder })
    }

    /// Writes the result, whether it is evidence, and where it is.
    pub(super) fn finish(mut self, passed: bool, result: &impl Serialize) -> Result<(), Failure> {
        // The log has no value without its end.
        self.line.flush().incomplete()?;
        status!("evidence in {}", self.folder.path().display());
        self.folder.finish(passed, result).incomplete()
    }

    /// Writes that the step failed, and why.
    pub(super) fn fail(self, error: MotionError) -> Failure {
        let exit = match &error {
            MotionError::Stopped { cause: StopCause::Requested, .. } => Exit::Interrupted,
            MotionError::Stopped { .. } | MotionError::StaysOn { .. } | MotionError::Line(_) => {
                Exit::SafeStop
            }
            MotionError::Way { .. } | MotionError::NoHomePosition { .. } | MotionError::Powered { .. } => {
                Exit::Usage
            }
            _ => Exit::Failed,
        };
        let written = self.finish(false, &json!({ "error": error.to_string() }));
        written.err().unwrap_or_else(|| Failure::with(exit, error))
    }
}

/// Serial numbers (1018h:04); none of a drive that tells none.
pub(super) fn serials(line: &mut Line) -> [Option<u32>; AXES] {
    std::array::from_fn(|axis| line.read_number(axis, ObjectAddress::new(0x1018, 4)).ok())
}
