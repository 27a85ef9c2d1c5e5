//! The drives of a scenario on their line, with what each of them needs.

use std::io::Write;

use anyhow::ensure;
use masseter_can::canopen::NodeId;
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_plant::bringup::{BootUps, Deviation, Line, LineError, Settings, Survey, deviations};
use masseter_plant::wanted::WantedDrive;
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_scenario::{CanConfig, Scenario};
use masseter_terminal::{Exit, Failure};

use super::identity::{Identity, Known};

/// How long the drives may take to boot at power-on before they are read, ns.
const LISTEN_NS: u64 = 500 * MILLISECOND_NS;

/// What each drive said of itself, as far as it was asked.
pub(crate) type Surveys = [Option<Survey>; AXES];

/// A line to the drives of a scenario.
#[derive(Debug)]
pub(crate) struct RobotLine {
    pub(crate) scenario: Scenario,
    pub(crate) line: Line,
    wanted: Vec<WantedDrive>,
    settings: Vec<Settings>,
}

impl RobotLine {
    /// Opens the interfaces, or simulated buses; nothing is sent.
    ///
    /// # Errors
    /// When an interface cannot be opened, or a value is not one that a profile allows.
    pub(crate) fn open(scenario: Scenario, log: Box<dyn Write + Send>) -> anyhow::Result<Self> {
        let of_axis = |axis: usize| {
            let node = NodeId::new(scenario.can.node_ids[axis])?;
            anyhow::Ok(WantedDrive::of_axis(&scenario, axis, node)?)
        };
        let wanted = (0..AXES).map(of_axis).collect::<Result<Vec<_>, _>>()?;
        let settings = wanted.iter().map(Settings::wanted).collect();
        Ok(Self { line: Line::open(&scenario, log)?, scenario, wanted, settings })
    }

    /// What the rig needs of a drive.
    pub(crate) fn settings(&self, axis: usize) -> &Settings {
        &self.settings[axis]
    }

    /// Listens until all drives may have booted. Returns their boot-ups until then: after a restart a survey is no more
    /// than a memory.
    ///
    /// # Errors
    /// When the bus or the log fails.
    pub(crate) fn listen(&mut self) -> Result<BootUps, LineError> {
        self.line.listen(LISTEN_NS)?;
        Ok(BootUps::until_now(&self.line))
    }

    /// Surveys of the drives that are to be written.
    ///
    /// # Errors
    /// When the bus or the log fails, or a drive does not answer, or restarts.
    pub(crate) fn surveys(
        &mut self,
        targets: &[(usize, Settings)],
        boot_ups: BootUps,
    ) -> anyhow::Result<Surveys> {
        let mut surveys = [const { None }; AXES];
        for (axis, target) in targets {
            let survey = self.whole_survey(*axis, target);
            boot_ups.check_axis(&self.line, *axis)?;
            surveys[*axis] = Some(survey?);
        }
        Ok(surveys)
    }

    /// What a drive says of itself, and of the objects of these settings.
    ///
    /// # Errors
    /// When the bus or the log fails.
    pub(crate) fn survey(&mut self, axis: usize, settings: &Settings) -> Result<Survey, LineError> {
        Survey::take(&mut self.line, axis, settings.addresses())
    }

    /// The same of a drive that answers to the end.
    ///
    /// # Errors
    /// When the bus or the log fails, or the drive does not answer.
    pub(crate) fn whole_survey(&mut self, axis: usize, settings: &Settings) -> anyhow::Result<Survey> {
        let survey = self.survey(axis, settings)?;
        ensure!(!survey.fell_silent(), "{}: {}", AXIS_NAMES[axis], self.silence(axis));
        Ok(survey)
    }

    /// Whether a drive still says who it is.
    pub(crate) fn answers(&mut self, axis: usize) -> bool {
        Identity::read(&mut self.line, &self.scenario.can, axis).is_ok()
    }

    /// Everything of a drive that is not as scenario and profile need it.
    pub(crate) fn deviations(&self, axis: usize, survey: &Survey) -> Vec<Deviation> {
        deviations(survey, &self.wanted[axis], &self.settings[axis], self.scenario.profile(axis))
    }

    /// What to do about a drive that does not answer.
    pub(crate) fn silence(&self, axis: usize) -> String {
        let node = self.scenario.can.node_ids[axis];
        format!(
            "node {node} does not answer; check its power, wiring, bit rate and node id (inspect --scan finds others)"
        )
    }
}

/// A drive or a bus that is not as the step needs it: exit code 1.
pub(crate) fn failed(error: impl Into<anyhow::Error>) -> Failure {
    Failure::with(Exit::Failed, error)
}

/// The drives that were surveyed.
pub(crate) fn drives(surveys: &Surveys, can: &CanConfig) -> [Known; AXES] {
    std::array::from_fn(|axis| Known::of_survey(surveys[axis].as_ref(), can.node_ids[axis]))
}
