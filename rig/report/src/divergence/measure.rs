//! The size of a difference between two values of a field, in a unit for people.

use masseter_recording::Field;

/// What the name of a field ends with, the unit for its differences, and how many of these make one of the field's unit.
/// The longest ends come first.
const UNITS: [(&str, &str, f64); 7] = [
    ("_per_s", "1/s", 1.0),
    ("_m_s", "mm/s", 1e3),
    ("_rad", "mrad", 1e3),
    ("_ns", "µs", 1e-3),
    ("_m", "µm", 1e6),
    ("_n", "N", 1.0),
    ("_s", "ms", 1e3),
];

/// How differences of a field are measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Measure {
    /// The largest difference of an element, by a unit and its number in the field's unit.
    Elements(&'static str, f64),
    /// The distance of two points, µm.
    Distance,
    /// The angle between two orientations, mrad.
    Turn,
    /// Codes and counts have no measure.
    None,
}

impl Measure {
    pub(super) fn of(field: &Field, elements: usize) -> Self {
        let name = field.name();
        let unit = UNITS.iter().find(|(end, _, _)| name.ends_with(end));
        match (name, unit) {
            (name, _) if name.ends_with("quaternion_wxyz") => Self::Turn,
            (name, _) if name.ends_with("position_m") && elements == 3 => Self::Distance,
            (_, Some((_, unit, factor))) => Self::Elements(unit, *factor),
            (_, None) if field.is_integer() => Self::None,
            (_, None) => Self::Elements("", 1.0),
        }
    }

    pub(super) fn unit(self) -> &'static str {
        match self {
            Self::Elements(unit, _) => unit,
            Self::Distance => "µm",
            Self::Turn => "mrad",
            Self::None => "",
        }
    }

    /// The size of the difference; none where it has no measure, or a value is no number.
    pub(super) fn size(self, a: &[f64], b: &[f64]) -> Option<f64> {
        let differences = || a.iter().zip(b).map(|(a, b)| b - a);
        let norm = |sign: f64| a.iter().zip(b).map(|(a, b)| (sign * b - a).powi(2)).sum::<f64>().sqrt();
        let size = match self {
            Self::Elements(_, factor) => {
                // Unlike `max`, this keeps what is no number.
                factor
                    * differences()
                        .map(f64::abs)
                        .fold(0.0, |most, size| if size <= most { most } else { size })
            }
            Self::Distance => 1e6 * norm(1.0),
            // A quaternion and its negative are one orientation; the chord between two is twice the sine of a quarter.
            Self::Turn => 1e3 * 4.0 * (norm(1.0).min(norm(-1.0)) / 2.0).min(1.0).asin(),
            Self::None => return None,
        };
        size.is_finite().then_some(size)
    }
}

#[cfg(test)]
mod tests {
    use masseter_recording::Columns;

    use super::*;

    fn sized(definition: &str, a: &[f64], b: &[f64]) -> (Option<String>, &'static str) {
        let columns = Columns::from_definition(definition).unwrap();
        let measure = Measure::of(&columns.fields()[0], a.len());
        (measure.size(a, b).map(|size| format!("{size:.3}")), measure.unit())
    }

    #[test]
    fn lengths_are_in_micrometres_angles_in_milliradians_and_codes_without_a_measure() {
        let text = |size: &str| Some(size.to_owned());
        assert_eq!(sized("float64[6] target_m", &[0.1, 0.2], &[0.1, 0.2 + 2e-6]), (text("2.000"), "µm"));
        assert_eq!(sized("float64[3] position_m", &[0.0; 3], &[3e-6, 4e-6, 0.0]), (text("5.000"), "µm"));
        assert_eq!(sized("float64[3] leg_angle_rad", &[1.0], &[1.002]), (text("2.000"), "mrad"));
        assert_eq!(sized("float64[6] joint_m_s", &[1.0], &[1.5]), (text("500.000"), "mm/s"));
        assert_eq!(sized("float64 gain", &[1.0], &[1.5]), (text("0.500"), ""));
        assert_eq!(sized("uint32 request", &[1.0], &[2.0]), (None, ""));
        assert_eq!(sized("float64[6] force_n", &[1.0], &[f64::NAN]), (None, "N"));
    }

    #[test]
    fn the_turn_between_two_quaternions_is_their_angle_whatever_their_signs() {
        let about_x = |angle: f64| [(angle / 2.0).cos(), (angle / 2.0).sin(), 0.0, 0.0];
        let negative = about_x(0.003).map(|part| -part);
        for other in [about_x(0.003), negative] {
            let found = sized("float64[4] quaternion_wxyz", &about_x(0.0), &other);
            assert_eq!(found, (Some("3.000".to_owned()), "mrad"));
        }
    }
}
