//! A step that moves or reads the drives, from the claimed interfaces to its evidence and exit code.

use anyhow::Context;
use masseter_commissioning::{
    AxisError, BootUps, Disturbance, Identity, Known, Line, LineError, MotionError, NOT_ASKED, StopCause,
    check_present, check_undisturbed,
};
use masseter_model::geometry::AXES;
use masseter_runtime::lifecycle::StopRequest;
use masseter_terminal::{Exit, Failure, OrFailure, status};
use serde::Serialize;
use serde_json::{Value, json};

use super::evidence::{Past, StepFolder};
use super::ledger::{OwedFiles, return_owed_values};
use super::robot_line::{LISTEN_NS, failed, wanted_drive, warn_of_gaps, warn_of_interfaces};
use super::{args::RobotArgs, basis::Basis, power_mark::remove_mark, step::Step};

/// All axes.
const ALL: [usize; AXES] = [0, 1, 2, 3, 4, 5];

/// A step under way.
pub(super) struct Session {
    pub(super) scenario: masseter_scenario::Scenario,
    pub(super) line: Line,
    pub(super) stop: StopRequest,
    pub(super) past: Past,
    /// The results of the axes so far, for a step that fails at a later axis.
    pub(super) results: Option<Value>,
    folder: StepFolder,
    /// Boot-up messages before the step.
    boot_ups: BootUps,
    /// The drives at the beginning.
    drives: [Known; AXES],
}

impl Session {
    /// Claims the interfaces, makes the folder, and refuses without the evidence of the earlier step for each of
    /// these axes; none for a step out of order.
    pub(super) fn begin(
        args: &RobotArgs,
        step: Step,
        axes: &[usize],
        earlier: Option<impl Fn(usize) -> Step>,
    ) -> Result<Self, Failure> {
        let scenario = args.scenario().usage()?;
        let stop = StopRequest::listen_alone().context("cannot listen for signals").died()?;
        let past = Past::read(&args.folder).usage()?;
        let needed =
            earlier.map(|earlier| axes.iter().map(|&axis| (earlier(axis), axis)).collect::<Vec<_>>());
        let require = |basis: &Basis| {
            let mut needed = needed.iter().flatten();
            needed.try_for_each(|&(earlier, axis)| past.require(earlier, &[axis], basis))
        };
        // A refused step makes no folder: it would replace the evidence of the same step from before.
        require(&Basis::new(&scenario, NOT_ASKED)).usage()?;
        let mut folder = StepFolder::begin(&args.folder, step, axes, &scenario).usage()?;
        folder.evidence.in_order = needed.is_some();
        let log = folder.log().context("cannot write the log of the buses").incomplete()?;
        let mut line = Line::open(&scenario, log).usage()?;
        warn_of_interfaces(&scenario.can);
        line.listen(LISTEN_NS).died()?;
        line.strangers().refuse_masters().usage()?;
        let boot_ups = BootUps::until_now(&line);
        let identities = Identity::read_all(&mut line, &scenario.can).map_err(failed)?;
        let drives = identities.map(Known::Is);
        folder.evidence.basis.drives = drives;
        require(&folder.evidence.basis).usage()?;
        for &axis in axes {
            let wanted = wanted_drive(&scenario, axis).usage()?;
            identities[axis].check_kind(axis, &wanted).map_err(failed)?;
        }
        warn_of_gaps(&drives);
        return_owed_values(&args.folder, &scenario, &mut line, false)?;
        // A step that borrows the marked object must not return a mark.
        if matches!(step, Step::Jog(_) | Step::Watchdog | Step::Home) {
            axes.iter().try_for_each(|&axis| remove_mark(&past, &scenario, &mut line, axis))?;
        }
        line.keep_old_values_in(Box::new(OwedFiles { folder: args.folder.clone(), drives: identities }));
        Ok(Self { scenario, line, stop, past, results: None, folder, boot_ups, drives })
    }

    /// Refuses a drive that restarted since the step began, since it may have lost its position or what was written,
    /// and another master.
    pub(super) fn check_undisturbed(&self) -> Result<(), Disturbance> {
        check_undisturbed(&self.line, &ALL, self.boot_ups)
    }

    /// The same before the step is judged, and checks that every drive still answers.
    pub(super) fn check_present(&mut self) -> Result<(), Disturbance> {
        check_present(&mut self.line, &self.scenario.can, &ALL, self.boot_ups, &self.drives)
    }

    /// Writes the result, whether it is evidence, and where it is.
    pub(super) fn finish_session(mut self, passed: bool, result: &impl Serialize) -> Result<(), Failure> {
        // The log has no value without its end.
        self.line.flush().incomplete()?;
        status!("evidence in {}", self.folder.files.path().display());
        self.folder.finish_step(passed, result).incomplete()
    }

    /// Writes that the step failed, why, and the results of the axes before, if any.
    pub(super) fn fail(mut self, exit: Exit, error: impl Into<anyhow::Error>) -> Failure {
        let error = error.into();
        let mut result = json!({ "error": error.to_string() });
        if let Some(before) = self.results.take() {
            result["before"] = before;
        }
        let written = self.finish_session(false, &result);
        written.err().unwrap_or_else(|| Failure::with(exit, error))
    }

    /// The same of a motion.
    pub(super) fn fail_motion(self, error: MotionError) -> Failure {
        let exit = match &error {
            // No motion begins before its values are in the drive.
            MotionError::Line(LineError::NotKept { .. }) => Exit::Failed,
            MotionError::Line(_) | MotionError::Unread { .. } => Exit::SafeStop,
            MotionError::OfAxis { reason, .. } => match reason {
                AxisError::Stopped(StopCause::Requested) => Exit::Interrupted,
                AxisError::Stopped(_) | AxisError::StaysOn(_) => Exit::SafeStop,
                AxisError::Way { .. } | AxisError::NoHomePosition | AxisError::Powered(_) => Exit::Usage,
                _ => Exit::Failed,
            },
        };
        self.fail(exit, error)
    }
}
