//! The drives of a scenario on their line: what each of them needs, what it is without, and whether it has power.

use std::io::Write;

use masseter_commissioning::{
    BootUps, Deviation, Known, Line, Outcome, PowerError, Settings, Survey, deviations, gaps, prove_no_power,
    take_over,
};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_plant::{judge_interfaces, wanted::WantedDrive};
use masseter_scenario::{CanConfig, Scenario};
use masseter_terminal::{Exit, Failure, status};

/// How long a step listens before its first question, ns: drives boot at power-on, and another master shows.
pub(super) const LISTEN_NS: u64 = 500 * masseter_runtime::clock::MILLISECOND_NS;

/// Columns of the table of deviations.
const HEAD: [&str; 6] = ["axis", "object", "wanted", "found", "configure", "decided by"];

/// What each drive said of itself, as far as it was asked.
pub(crate) type Surveys = [Option<Survey>; AXES];

/// A line to the drives of a scenario.
pub(crate) struct RobotLine {
    pub(crate) scenario: Scenario,
    pub(crate) line: Line,
    wanted: Vec<WantedDrive>,
    /// What the rig needs of each drive.
    pub(crate) settings: Vec<Settings>,
}

impl RobotLine {
    /// Opens the interfaces, or simulated buses; nothing is sent.
    ///
    /// # Errors
    /// When an interface cannot be opened, or a value is not one that a profile allows.
    pub(crate) fn open(scenario: Scenario, log: Box<dyn Write + Send>) -> anyhow::Result<Self> {
        let wanted = (0..AXES).map(|axis| wanted_drive(&scenario, axis)).collect::<Result<Vec<_>, _>>()?;
        let settings = wanted.iter().map(Settings::wanted).collect();
        Ok(Self { line: Line::open(&scenario, log)?, scenario, wanted, settings })
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

    /// What a drive says of itself, and of the objects of these settings, to the end.
    ///
    /// # Errors
    /// When the bus or the log fails, or the drive does not answer.
    pub(crate) fn whole_survey(&mut self, axis: usize, settings: &Settings) -> anyhow::Result<Survey> {
        let survey = Survey::of_drive(&mut self.line, axis, settings.addresses())?;
        anyhow::ensure!(!survey.fell_silent(), "{}: {}", AXIS_NAMES[axis], self.silence(axis));
        Ok(survey)
    }

    /// Everything of a drive that is not as scenario and profile need it.
    pub(crate) fn deviations(&self, axis: usize, survey: &Survey) -> Vec<Deviation> {
        deviations(survey, &self.wanted[axis], &self.settings[axis], self.scenario.profile(axis))
    }

    /// What to do about a drive that does not answer.
    pub(crate) fn silence(&self, axis: usize) -> String {
        let node = self.scenario.can.node_ids[axis];
        let remedy = "check its power, wiring, bit rate and node id (inspect --scan finds others)";
        format!("node {node} does not answer; {remedy}")
    }
}

/// What a scenario wants of the drive of an axis.
///
/// # Errors
/// When a value is not one that a profile allows.
pub(super) fn wanted_drive(scenario: &Scenario, axis: usize) -> anyhow::Result<WantedDrive> {
    let node = masseter_can::canopen::NodeId::new(scenario.can.node_ids[axis])?;
    Ok(WantedDrive::of_axis(scenario, axis, node)?)
}

/// A drive or a bus that is not as the step needs it: exit code 1.
pub(crate) fn failed(error: impl Into<anyhow::Error>) -> Failure {
    Failure::with(Exit::Failed, error)
}

/// The drives that were surveyed.
pub(crate) fn drives(surveys: &Surveys, can: &CanConfig) -> [Known; AXES] {
    std::array::from_fn(|axis| Known::of_survey(surveys[axis].as_ref(), can.node_ids[axis]))
}

/// Warns of what may go wrong on real interfaces.
pub(crate) fn warn_of_interfaces(can: &CanConfig) {
    // The opening refuses an interface that cannot be judged.
    for doubt in judge_interfaces(can).iter().flatten().flat_map(|judged| &judged.doubts) {
        status!("warning: {doubt}");
    }
}

/// Warns of what the identities of drives leave open.
pub(crate) fn warn_of_gaps(drives: &[Known; AXES]) {
    for gap in gaps(drives) {
        status!("warning: {gap}");
    }
}

/// Proves that a drive has no power; one that has is stopped first if that is allowed.
pub(super) fn prove_off(
    line: &mut Line,
    scenario: &Scenario,
    axis: usize,
    may_stop: bool,
) -> Result<(), Failure> {
    let noise = scenario.scale(axis).window(scenario.profile(axis).homing.tolerance_m);
    match prove_no_power(line, axis, noise) {
        Err(PowerError::Powered { .. }) if may_stop => {
            take_over(line, axis, noise).map_err(failed)?;
            // A drive that the rig could not stop is the case of an emergency stop.
            prove_no_power(line, axis, noise).map_err(|error| Failure::with(Exit::SafeStop, error))
        }
        proved => proved.map_err(failed),
    }
}

/// Names of axes; all of them in one word.
pub(crate) fn axes_text(axes: &[usize]) -> String {
    if axes.len() == AXES {
        return "all".to_owned();
    }
    axes.iter().map(|&axis| AXIS_NAMES[axis]).collect::<Vec<_>>().join(" ")
}

/// Deviations as a table; equal ones of several drives share a row. Empty without a deviation.
pub(crate) fn deviations_table(deviations: &[(usize, Deviation)]) -> String {
    let mut rows: Vec<(Vec<usize>, &Deviation)> = Vec::new();
    for (axis, deviation) in deviations {
        match rows.iter_mut().find(|(_, known)| *known == deviation) {
            Some((axes, _)) => axes.push(*axis),
            None => rows.push((vec![*axis], deviation)),
        }
    }
    if rows.is_empty() {
        return String::new();
    }
    let cells = rows.iter().map(|(axes, deviation)| {
        let remedy = match deviation.outcome {
            Outcome::Mended => deviation.remedy.clone(),
            Outcome::Doubtful => format!("(look) {}", deviation.remedy),
            Outcome::Refused => format!("REFUSES: {}", deviation.remedy),
        };
        let object = format!("{} {}", deviation.object, deviation.name).trim_end().to_owned();
        let (wanted, found) = (deviation.wanted.clone(), deviation.found.clone());
        [axes_text(axes), object, wanted, found, remedy, deviation.key.clone()]
    });
    let all: Vec<_> = [HEAD.map(str::to_owned)].into_iter().chain(cells).collect();
    let width = |column: usize| all.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: [usize; 6] = std::array::from_fn(width);
    let line = |row: &[String; 6]| {
        let padded: Vec<_> = row.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
        padded.join("  ").trim_end().to_owned() + "\n"
    };
    all.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use masseter_can::canopen::ObjectAddress;

    use super::*;

    #[test]
    fn equal_deviations_share_a_row() {
        let deviation = |wanted: &str| Deviation {
            object: ObjectAddress::new(0x6066, 0),
            name: "Following error time out",
            wanted: wanted.to_owned(),
            found: "0".to_owned(),
            outcome: Outcome::Mended,
            remedy: format!("write {wanted}"),
            key: "key".to_owned(),
        };
        let mut all: Vec<_> = (0..AXES).map(|axis| (axis, deviation("20"))).collect();
        all.push((3, deviation("7")));
        let text = deviations_table(&all);
        let rows: Vec<_> = text.lines().collect();
        assert_eq!(rows.len(), 3, "{text}");
        assert!(rows[1].starts_with("all   6066h:00h Following error time out  20"), "{text}");
        assert!(rows[2].starts_with("l1 "), "{text}");
        assert_eq!(deviations_table(&[]), "");
    }
}
