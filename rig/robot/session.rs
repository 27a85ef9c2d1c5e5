//! A step that moves or reads the drives, from the claimed interfaces to its evidence and exit code.

use anyhow::Context;
use masseter_can::canopen::NodeId;
use masseter_model::geometry::AXES;
use masseter_plant::bringup::{BootUps, Line, LineError, MotionError, StopCause};
use masseter_plant::wanted::WantedDrive;
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_runtime::lifecycle::StopRequest;
use masseter_scenario::Scenario;
use masseter_terminal::{Exit, Failure, OrFailure, status};
use serde::Serialize;
use serde_json::json;

use super::args::RobotArgs;
use super::evidence::{Basis, StepFolder};
use super::identity::{Identity, Known, NOT_ASKED, warn_of_gaps};
use super::ledger::{self, Files};
use super::past::Past;
use super::power_mark;
use super::presence::{Disturbance, check_present, check_undisturbed};
use super::robot_line::failed;
use super::step::Step;

/// How long the step listens for other masters, ns.
const LISTEN_NS: u64 = 500 * MILLISECOND_NS;
/// All axes.
const ALL: [usize; AXES] = [0, 1, 2, 3, 4, 5];

/// A step under way.
pub(super) struct Session {
    pub(super) scenario: Scenario,
    pub(super) line: Line,
    pub(super) stop: StopRequest,
    pub(super) past: Past,
    folder: StepFolder,
    /// Boot-up messages before the step.
    boot_ups: BootUps,
    /// The drives at the beginning.
    drives: [Known; AXES],
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
        require(&Basis::new(&scenario, NOT_ASKED)).usage()?;
        let mut folder = StepFolder::begin(&args.folder, step, axes, &scenario).usage()?;
        if axes.iter().any(|&axis| earlier(axis).is_none()) {
            folder.note_out_of_order();
        }
        let log = folder.log().context("cannot write the log of the buses").incomplete()?;
        let mut line = Line::open(&scenario, log).usage()?;
        line.listen(LISTEN_NS).died()?;
        line.strangers().refuse_masters().usage()?;
        let boot_ups = BootUps::until_now(&line);
        let identities = Identity::read_all(&mut line, &scenario.can).map_err(failed)?;
        let drives = identities.map(Known::Is);
        folder.note_drives(drives);
        require(&folder.basis()).usage()?;
        for &axis in axes {
            let node = NodeId::new(scenario.can.node_ids[axis]).context("node ids").usage()?;
            let wanted = WantedDrive::of_axis(&scenario, axis, node).usage()?;
            identities[axis].check_kind(axis, &wanted).map_err(failed)?;
        }
        warn_of_gaps(&drives);
        ledger::settle(&args.folder, &scenario, &mut line, false)?;
        // A step that borrows the marked object must not return a mark.
        if matches!(step, Step::Jog(_) | Step::Home) {
            axes.iter().try_for_each(|&axis| power_mark::remove(&past, &scenario, &mut line, axis))?;
        }
        line.keep_old_values_in(Box::new(Files::new(&args.folder, identities)));
        Ok(Self { scenario, line, stop, past, folder, boot_ups, drives })
    }

    /// Refuses a drive that restarted since the step began, since it may have lost its position or what was written,
    /// and another master.
    pub(super) fn check_undisturbed(&self) -> Result<(), Disturbance> {
        check_undisturbed(&self.line, &ALL, self.boot_ups)
    }

    /// The same before the step is judged, and asks every drive whether it is still there.
    pub(super) fn check_present(&mut self) -> Result<(), Disturbance> {
        check_present(&mut self.line, &self.scenario.can, &ALL, self.boot_ups, &self.drives)
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
            // No motion begins before its values are in the drive.
            MotionError::Line(LineError::NotKept { .. }) => Exit::Failed,
            MotionError::Stopped { cause: StopCause::Requested, .. } => Exit::Interrupted,
            MotionError::Stopped { .. }
            | MotionError::StaysOn { .. }
            | MotionError::Unread { .. }
            | MotionError::Line(_) => Exit::SafeStop,
            MotionError::Way { .. } | MotionError::NoHomePosition { .. } | MotionError::Powered { .. } => {
                Exit::Usage
            }
            _ => Exit::Failed,
        };
        let written = self.finish(false, &json!({ "error": error.to_string() }));
        written.err().unwrap_or_else(|| Failure::with(exit, error))
    }
}
