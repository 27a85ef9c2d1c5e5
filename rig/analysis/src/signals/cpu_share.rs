//! The share of its core that a loop takes, from the account of its time in its messages.

/// Follows the account of a loop.
#[derive(Debug, Clone, Default)]
pub(super) struct CpuShare {
    last: Option<[u64; 2]>,
}

impl CpuShare {
    /// The share since the message before, from the time of this one's wake-up and the time that the loop has worked and spun
    /// since the start, ns. None in simulated time, which has no account.
    pub(super) fn take(&mut self, account: Option<[u64; 2]>) -> Option<f64> {
        let [woke_ns, busy_ns] = account.filter(|[_, busy_ns]| *busy_ns > 0)?;
        let [before_ns, busy_before_ns] = self.last.replace([woke_ns, busy_ns])?;
        let elapsed_ns = woke_ns.checked_sub(before_ns).filter(|elapsed_ns| *elapsed_ns > 0)?;
        Some(busy_ns.saturating_sub(busy_before_ns) as f64 / elapsed_ns as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_of_the_time_since_the_message_before() {
        let mut share = CpuShare::default();
        let accounts =
            [None, Some([1000, 500]), Some([2000, 750]), None, Some([4000, 1250]), Some([4000, 1300])];
        assert_eq!(
            accounts.map(|account| share.take(account)),
            [None, None, Some(0.25), None, Some(0.25), None]
        );
        assert_eq!(CpuShare::default().take(Some([1000, 0])), None, "simulated time");
    }
}
