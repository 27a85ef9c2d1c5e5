//! What a step's result depends on: the drives, the build, and every value of the scenario that decides objects or scales.

use std::fmt::{self, Display, Formatter};

use masseter_commissioning::Known;
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_plant::wanted::rpdo_timeout_ms;
use masseter_scenario::Scenario;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

/// What a result depends on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Basis {
    /// Build, times of the watchdogs, interfaces, jaw, mechanism with its strokes, and node, profile and scale of each axis, by their names.
    pub(crate) decided_by: Value,
    /// The drives.
    pub(crate) drives: [Known; AXES],
}

impl Basis {
    /// Of a scenario and of these drives. Limits of a run do not count: a run writes them itself, and a dry run has others.
    pub(crate) fn new(scenario: &Scenario, drives: [Known; AXES]) -> Self {
        let of_axis = |axis: usize| {
            let (node, profile, scale) =
                (scenario.can.node_ids[axis], scenario.profile(axis), scenario.scale(axis));
            json!({ "node": node, "profile": profile, "scale": scale })
        };
        let axes: Map<_, _> = (0..AXES).map(|axis| (AXIS_NAMES[axis].to_owned(), of_axis(axis))).collect();
        let Scenario { can, jaw, dry, .. } = scenario;
        let mut mechanism = scenario.mechanism.clone();
        // A dry run shortens the strokes, which are still those of the robot.
        let margin_m = if dry.is_on { dry.stroke_margin_mm * 1e-3 } else { 0.0 };
        for [low_m, high_m] in [&mut mechanism.strokes.slide_m, &mut mechanism.strokes.leg_m] {
            (*low_m, *high_m) = (to_nm(*low_m - margin_m), to_nm(*high_m + margin_m));
        }
        // Evidence of emulated drives is none of real ones.
        let watchdogs = json!({
            "heartbeat_ms": can.heartbeat_consumer_ms, "process_data_ms": rpdo_timeout_ms(scenario)
        });
        let decided_by = json!({
            "watchdogs": watchdogs, "axes": axes, "build": crate::BUILD, "interfaces": can.interfaces, "jaw": jaw, "mechanism": mechanism
        });
        Self { decided_by, drives }
    }

    /// The first value that another basis has otherwise, in the order of the names.
    pub(crate) fn difference(&self, now: &Self) -> Option<Difference> {
        Difference::between(&self.decided_by, &now.decided_by, "")
    }
}

/// Rounds a length to a nanometre, m.
fn to_nm(length_m: f64) -> f64 {
    (length_m * 1e9).round() / 1e9
}

/// A value that differs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Difference {
    /// The names that lead to it, such as `axes.l1.scale.increment_m`.
    place: String,
    before: Value,
    now: Value,
}

impl Difference {
    fn between(before: &Value, now: &Value, place: &str) -> Option<Self> {
        if before == now {
            return None;
        }
        let (Value::Object(old), Value::Object(new)) = (before, now) else {
            return Some(Self { place: place.to_owned(), before: before.clone(), now: now.clone() });
        };
        let child = |name: &String| {
            let place = if place.is_empty() { name.clone() } else { format!("{place}.{name}") };
            Self::between(
                old.get(name).unwrap_or(&Value::Null),
                new.get(name).unwrap_or(&Value::Null),
                &place,
            )
        };
        old.keys().chain(new.keys()).find_map(child)
    }
}

impl Display for Difference {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} was {}, and is {}", self.place, self.before, self.now)
    }
}

#[cfg(test)]
mod tests {
    use masseter_commissioning::NOT_ASKED;

    use super::*;

    #[test]
    fn the_first_difference_is_named_with_both_values() {
        let before = Basis::new(&Scenario::default(), NOT_ASKED);
        assert_eq!(before.difference(&before), None);
        let text = serde_json::to_string(&before).unwrap();
        let read: Basis = serde_json::from_str(&text).unwrap();
        assert_eq!(read, before, "a file holds every digit");
        let mut scenario = Scenario::default();
        scenario.mechanism.strokes.leg_m[1] += 0.01;
        scenario.can.interfaces = vec!["can0".to_owned(), "can1".to_owned()];
        let difference = before.difference(&Basis::new(&scenario, NOT_ASKED)).unwrap();
        assert_eq!(difference.to_string(), r#"interfaces was [], and is ["can0","can1"]"#);
        scenario.can.interfaces.clear();
        let difference = before.difference(&Basis::new(&scenario, NOT_ASKED)).unwrap().to_string();
        assert!(difference.starts_with("mechanism.strokes.leg_m was ["), "{difference}");
    }

    #[test]
    fn limits_of_a_run_are_no_part_of_it() {
        let before = Basis::new(&Scenario::default(), NOT_ASKED);
        let mut scenario = Scenario { rate_hz: 500, ..Scenario::default() };
        scenario.drives.leg.max_force_n /= 2.0;
        assert_eq!(before.difference(&Basis::new(&scenario, NOT_ASKED)), None);
    }
}
