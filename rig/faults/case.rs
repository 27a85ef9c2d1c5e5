//! The cases of the matrix: a fault of each kind, at each axis, in each phase, with a size that a real one may have.

use masseter_model::geometry::AXIS_NAMES;
use masseter_scenario::{FaultConfig, FaultKindConfig, FaultLayer, FaultPlace, Quantity, Scenario};

use super::phases::Phase;

/// How long a fault acts that does not last, s.
const FOR_S: f64 = 0.5;

/// A fault to be played.
#[derive(Debug, Clone)]
pub(super) struct Case {
    pub(super) fault: FaultConfig,
    /// The axis concerned, directly or through its node.
    pub(super) axis: Option<usize>,
    pub(super) phase: &'static str,
}

/// Every case. Faults of processes are left out: they exist only with processes.
pub(super) fn cases(scenario: &Scenario, phases: &[Phase], filter: Option<&str>) -> Vec<Case> {
    let kinds = FaultKindConfig::ALL.iter().filter(|kind| {
        kind.layer() != FaultLayer::Process && filter.is_none_or(|text| kind.name().contains(text))
    });
    kinds.flat_map(|kind| of_kind(*kind, scenario, phases)).collect()
}

fn of_kind(kind: FaultKindConfig, scenario: &Scenario, phases: &[Phase]) -> Vec<Case> {
    let axes: Vec<_> = match kind.place() {
        FaultPlace::Fixed => vec![None],
        _ => (0..AXIS_NAMES.len()).map(Some).collect(),
    };
    let case = |axis: Option<usize>, phase: &Phase| Case {
        fault: fault(kind, axis, scenario, phase),
        axis,
        phase: phase.name,
    };
    // Only at the beginning of the run is a drive enabled.
    let boot = Phase { name: "enabling", at_s: 0.0 };
    let phases = if kind == FaultKindConfig::DriveSlowEnable { &[boot] } else { phases };
    axes.iter().flat_map(|axis| phases.iter().map(|phase| case(*axis, phase))).collect()
}

fn fault(kind: FaultKindConfig, axis: Option<usize>, scenario: &Scenario, phase: &Phase) -> FaultConfig {
    let is_at_boot = kind == FaultKindConfig::DriveSlowEnable;
    let name = axis.map(|axis| AXIS_NAMES[axis].to_owned());
    let of_bus = |value: Option<usize>| value.filter(|_| kind.layer() == FaultLayer::Bus);
    let bus = axis.and_then(|axis| scenario.can.buses.iter().position(|axes| axes.contains(&axis)));
    let node = axis.map(|axis| scenario.can.node_ids[axis]);
    FaultConfig {
        at_s: (!is_at_boot).then_some(phase.at_s),
        from_s: is_at_boot.then_some(0.0),
        for_s: (!is_at_boot).then_some(FOR_S),
        bus: of_bus(bus),
        node: node.filter(|_| kind.layer() == FaultLayer::Bus),
        axis: name.filter(|_| kind.layer() != FaultLayer::Bus),
        size: size(kind)
            .map(|text| text.parse::<Quantity>().expect("the sizes of this table are quantities")),
        ..FaultConfig::new(kind)
    }
}

/// A size that a real fault may have.
fn size(kind: FaultKindConfig) -> Option<&'static str> {
    use FaultKindConfig as Kind;
    Some(match kind {
        Kind::Delay => "1500 us",
        Kind::EncoderOffset | Kind::CommandJump | Kind::EndStop => "1 mm",
        Kind::EncoderDrift => "5 mm/s",
        Kind::EncoderNoise => "50 um",
        Kind::EncoderSteps => "0.1 mm",
        Kind::EncoderLoses => "5 %",
        Kind::EncoderDelay | Kind::EmcyStorm => "5 ms",
        Kind::DriveTorqueLoss => "50 %",
        Kind::DriveSlowEnable => "1 s",
        Kind::DriveReboot => "200 ms",
        Kind::DriveScale => "1.05",
        Kind::Friction => "5",
        Kind::Payload => "0.5 kg",
        Kind::Play => "0.2 mm",
        Kind::ControllerStall => "50 ms",
        _ => return None,
    })
}

/// The scenario of a case: long enough for the fault and what it leads to.
pub(super) fn scenario_of(base: &Scenario, case: &Case) -> Scenario {
    let end_s = case.fault.at_s.unwrap_or(1.0) + FOR_S + 1.0;
    Scenario { duration_s: Some(end_s), faults: vec![case.fault.clone()], ..base.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_is_a_valid_scenario() {
        let base = Scenario::default();
        let phases = [Phase { name: "opening", at_s: 1.6 }];
        let cases = cases(&base, &phases, None);
        let kinds: std::collections::BTreeSet<_> = cases.iter().map(|case| case.fault.kind).collect();
        let of_processes =
            FaultKindConfig::ALL.iter().filter(|kind| kind.layer() == FaultLayer::Process).count();
        assert_eq!(kinds.len(), FaultKindConfig::ALL.len() - of_processes);
        for case in &cases {
            scenario_of(&base, case).validate().unwrap_or_else(|error| panic!("{case:?}: {error}"));
        }
    }
}
