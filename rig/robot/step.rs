//! The steps of the bring-up in their order, with their names and commands.

use std::fmt::{self, Display, Formatter};

use masseter_model::geometry::{AXES, AXIS_NAMES};
use serde::{Deserialize, Serialize};

/// A step with evidence of its own, in the order of the bring-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub(crate) enum Step {
    /// All drives were read.
    Inspect,
    /// The drives have the rig's objects.
    Configure,
    /// The drives have their objects from before `Configure` again, whose evidence counts no more.
    Restore,
    /// An axis moved alone.
    Jog(usize),
    /// Each drive stops by itself once the master is silent.
    Watchdog,
    /// All axes have their zero.
    Home,
    /// The pose of the platform is the one that follows from the axes' positions.
    CheckPose,
    /// The motion was played slowly.
    DryRun,
}

impl Step {
    /// The steps that lead to a run.
    pub(crate) fn chain() -> Vec<Self> {
        let jogs = (0..AXES).map(Self::Jog);
        let last = [Self::Watchdog, Self::Home, Self::CheckPose, Self::DryRun];
        [Self::Inspect, Self::Configure].into_iter().chain(jogs).chain(last).collect()
    }

    /// The axes that the step must be about.
    pub(crate) fn axes(self) -> Vec<usize> {
        if let Self::Jog(axis) = self { vec![axis] } else { (0..AXES).collect() }
    }

    /// The command of the step.
    pub(crate) fn command(self) -> String {
        match self {
            Self::Jog(axis) => format!("masseter robot jog --axis {} --by 1mm", AXIS_NAMES[axis]),
            Self::DryRun => "masseter run --dry".to_owned(),
            _ => format!("masseter robot {self}"),
        }
    }
}

impl Display for Step {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Inspect => f.write_str("inspect"),
            Self::Configure => f.write_str("configure"),
            Self::Restore => f.write_str("restore"),
            Self::Jog(axis) => write!(f, "jog-{}", AXIS_NAMES[*axis]),
            Self::Watchdog => f.write_str("watchdog"),
            Self::Home => f.write_str("home"),
            Self::CheckPose => f.write_str("check-pose"),
            Self::DryRun => f.write_str("dry-run"),
        }
    }
}

impl From<Step> for String {
    fn from(step: Step) -> Self {
        step.to_string()
    }
}

impl TryFrom<String> for Step {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        let mut steps = Self::chain().into_iter().chain([Self::Restore]);
        steps.find(|step| step.to_string() == name).ok_or_else(|| format!("'{name}' is no step"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chain_is_in_order_and_every_step_has_a_command() {
        let chain = Step::chain();
        assert_eq!(chain.len(), 6 + AXES);
        assert!(chain.is_sorted());
        assert_eq!(chain[4].to_string(), "jog-d3");
        assert_eq!(chain[4].command(), "masseter robot jog --axis d3 --by 1mm");
    }

    #[test]
    fn a_step_is_read_by_its_name_and_no_other_word_is_a_step() {
        for step in Step::chain().into_iter().chain([Step::Restore]) {
            assert_eq!(Step::try_from(String::from(step)), Ok(step));
        }
        assert_eq!(Step::try_from("jog-l4".to_owned()), Err("'jog-l4' is no step".to_owned()));
    }
}
