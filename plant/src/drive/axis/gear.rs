//! A wrong gear ratio: the shaft moves by a multiple of what the drive is asked for, and the drive does not see that.
//!
//! The drive sees its shaft where it would be with the right ratio. So what it sees is the true position plus all that
//! the shaft moved too little. That stays when the ratio is right again: the shaft is where the wrong one led it.

/// The way that the shaft missed so far.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Gear {
    missed_m: f64,
    /// The demand at the last step with a wrong ratio.
    demand_m: Option<f64>,
}

impl Gear {
    /// The distance from where the shaft is to where the drive sees it, m, with a ratio while it is wrong and with the
    /// drive's demand.
    pub(super) fn error_m(&mut self, ratio: Option<f64>, demand_m: Option<f64>) -> f64 {
        let demand_m = demand_m.filter(|_| ratio.is_some());
        if let (Some(ratio), Some(from_m), Some(to_m)) = (ratio, self.demand_m, demand_m) {
            self.missed_m += (1.0 - ratio) * (to_m - from_m);
        }
        self.demand_m = demand_m;
        self.missed_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_shaft_moves_too_little_adds_up_while_the_ratio_is_wrong_and_stays() {
        let mut gear = Gear::default();
        let mut error_um = |ratio, demand_m| (gear.error_m(ratio, demand_m) * 1e6).round() as i64;
        assert_eq!(error_um(None, Some(0.270)), 0);
        assert_eq!(error_um(Some(0.9), Some(0.270)), 0, "from where it is");
        assert_eq!(error_um(Some(0.9), Some(0.280)), 1000);
        assert_eq!(error_um(Some(0.9), None), 1000, "the brake is closed");
        assert_eq!(error_um(Some(0.9), Some(0.250)), 1000);
        assert_eq!(error_um(Some(0.9), Some(0.240)), 0);
        assert_eq!(error_um(Some(1.5), Some(0.242)), -1000);
        assert_eq!(error_um(None, Some(0.270)), -1000);
    }
}
