//! The real interfaces of the buses: what the kernel says of them, and what of it is wrong.

use masseter_can::InterfaceDetails;
use masseter_scenario::CanConfig;
use serde::Serialize;

/// An interface, with its faults and its doubts in words.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct InterfaceResult {
    name: String,
    bitrate_bps: Option<u32>,
    sample_point_permille: Option<u32>,
    restart_ms: Option<u32>,
    state: Option<&'static str>,
    errors: Option<[u16; 2]>,
    pub(crate) faults: Vec<String>,
    pub(crate) doubts: Vec<String>,
}

/// All interfaces of a scenario; none for simulated buses.
pub(crate) fn interfaces(can: &CanConfig) -> Vec<InterfaceResult> {
    let read = |name: &String| judge(name, InterfaceDetails::read(name).unwrap_or_default(), can.bitrate_bps);
    can.interfaces.iter().map(read).collect()
}

fn judge(name: &str, details: InterfaceDetails, wanted_bps: u32) -> InterfaceResult {
    let InterfaceDetails { bitrate_bps, sample_point_permille, restart_ms, state, errors } = details;
    let (mut faults, mut doubts) = (Vec::new(), Vec::new());
    if let Some(bps) = bitrate_bps.filter(|&bps| bps != wanted_bps) {
        faults.push(format!(
            "{name} has {bps} bit/s, can.bitrate_bps is {wanted_bps}; 'ip link set {name} down' and 'ip link set {name} \
             up type can bitrate {wanted_bps} restart-ms 100' change it"
        ));
    }
    if let Some(state @ ("bus-off" | "stopped" | "error passive")) = state {
        faults.push(format!("{name} is {state}; check bit rate, termination and wiring"));
    }
    if restart_ms == Some(0) && bitrate_bps.is_some() {
        doubts.push(format!(
            "{name} has restart-ms 0: it stays off for good after bus-off; set restart-ms 100"
        ));
    }
    if let Some([sent, received]) = errors.filter(|errors| *errors != [0, 0]) {
        doubts.push(format!("{name} counts {sent} errors while sending and {received} while receiving"));
    }
    InterfaceResult {
        name: name.to_owned(),
        bitrate_bps,
        sample_point_permille,
        restart_ms,
        state,
        errors,
        faults,
        doubts,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_bit_rate_is_a_fault_and_no_restart_a_doubt() {
        let details = InterfaceDetails {
            bitrate_bps: Some(500_000),
            restart_ms: Some(0),
            state: Some("bus-off"),
            errors: Some([0, 3]),
            ..InterfaceDetails::default()
        };
        let result = judge("can0", details, 1_000_000);
        assert_eq!((result.faults.len(), result.doubts.len()), (2, 2), "{result:?}");
        assert!(result.faults[0].starts_with("can0 has 500000 bit/s, can.bitrate_bps is 1000000"));
        let virtual_one = judge("vcan0", InterfaceDetails::default(), 1_000_000);
        assert!(virtual_one.faults.is_empty() && virtual_one.doubts.is_empty());
    }
}
