//! Lengths and speeds of the command line.

/// A length with its unit, such as 1mm, -0.5mm, 20um or 0.001m: metres.
pub(super) fn parse_length(text: &str) -> Result<f64, String> {
    let units = [("mm", 1e-3), ("um", 1e-6), ("µm", 1e-6), ("m", 1.0)];
    let found = units.iter().find_map(|(unit, length_m)| Some((text.strip_suffix(unit)?, length_m)));
    found
        .and_then(|(number, length_m)| Some(number.trim().parse::<f64>().ok()? * length_m))
        .filter(|length_m| length_m.is_finite())
        .ok_or_else(|| "give a length with its unit, such as 1mm or -0.5mm".to_owned())
}

/// A speed with its unit, such as 2mm/s: m/s.
pub(super) fn parse_speed(text: &str) -> Result<f64, String> {
    let length_m = text.strip_suffix("/s").and_then(|length| parse_length(length).ok());
    length_m
        .filter(|speed_m_s| *speed_m_s > 0.0)
        .ok_or_else(|| "give a speed above 0 with its unit, such as 2mm/s".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_and_speeds_need_their_unit() {
        for (text, length_m) in [("1mm", 1e-3), ("-0.5 mm", -5e-4), ("20um", 2e-5), ("0.01m", 0.01)] {
            assert!((parse_length(text).unwrap() - length_m).abs() < 1e-15, "{text}");
        }
        for text in ["1", "mm", "1 inch", "NaNmm", ""] {
            assert!(parse_length(text).is_err(), "{text}");
        }
        assert!((parse_speed("2mm/s").unwrap() - 2e-3).abs() < 1e-15);
        assert!(["2mm", "0mm/s", "-1mm/s"].iter().all(|text| parse_speed(text).is_err()));
    }
}
