//! The drives of a scenario on their line, with what each of them needs.

use std::io::Write;

use anyhow::Context;
use masseter_can::canopen::{NodeId, ObjectAddress};
use masseter_plant::bringup::{BootUps, Deviation, Line, LineError, Settings, Strangers, Survey, deviations};
use masseter_plant::wanted::WantedDrive;
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::Scenario;
use masseter_shared::geometry::{AXES, AXIS_NAMES};
use masseter_terminal::{Exit, Failure};

/// Serial number.
const SERIAL: ObjectAddress = ObjectAddress::new(0x1018, 4);

/// How long the drives may take to boot at power-on before they are read, ns.
const LISTEN_NS: u64 = 500 * MILLISECOND_NS;

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

    /// What a drive says of itself.
    ///
    /// # Errors
    /// When the bus or the log fails.
    pub(crate) fn survey(&mut self, axis: usize) -> anyhow::Result<Survey> {
        Ok(Survey::take(&mut self.line, axis, self.settings[axis].addresses())?)
    }

    /// Surveys of these drives, and the boot-ups before: after a restart a survey is no more than a memory.
    ///
    /// # Errors
    /// When the bus or the log fails, or a drive does not answer.
    pub(crate) fn surveys(&mut self, axes: &[usize]) -> anyhow::Result<([Option<Survey>; AXES], BootUps)> {
        self.line.listen(LISTEN_NS)?;
        let (mut surveys, boot_ups) = ([const { None }; AXES], BootUps::until_now(&self.line));
        for &axis in axes {
            let survey = self.survey(axis)?;
            if survey.fell_silent() {
                anyhow::bail!("{}: {}", AXIS_NAMES[axis], self.silence(axis));
            }
            boot_ups.check_axis(&self.line, axis)?;
            surveys[axis] = Some(survey);
        }
        Ok((surveys, boot_ups))
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

    /// Refuses to go on where somebody else may control the drives.
    ///
    /// # Errors
    /// With the sign that was heard.
    pub(crate) fn refuse_masters(&self) -> anyhow::Result<()> {
        let signs = masters(self.line.strangers());
        match &signs[..] {
            [] => Ok(()),
            signs => Err(anyhow::anyhow!("{}: another master may control the drives", signs.join(", ")))
                .context("nothing was written; end that master first"),
        }
    }
}

/// A drive or a bus that is not as the step needs it: exit code 1.
pub(crate) fn failed(error: impl Into<anyhow::Error>) -> Failure {
    Failure::with(Exit::Failed, error)
}

/// Signs of other masters in words.
pub(crate) fn masters(strangers: &Strangers) -> Vec<String> {
    strangers.masters.iter().map(|(bus, sign)| format!("bus {bus}: {sign}")).collect()
}

/// The serial number of a drive; none where the drive says that it has none.
///
/// # Errors
/// [`LineError`], also for a drive that is silent: it may be any drive.
pub(crate) fn serial(line: &mut Line, axis: usize) -> Result<Option<u32>, LineError> {
    match line.read_number(axis, SERIAL) {
        Err(error) if error.abort_code().is_some() => Ok(None),
        read => read.map(Some),
    }
}

/// Serial numbers of the drives that were surveyed.
pub(crate) fn serials(surveys: &[Option<Survey>; AXES]) -> [Option<u32>; AXES] {
    std::array::from_fn(|axis| surveys[axis].as_ref()?.number(SERIAL))
}
