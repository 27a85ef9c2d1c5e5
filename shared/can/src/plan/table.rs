//! A plan as a table for the terminal.

use std::fmt;

use super::bus_plan::BusPlan;
use super::message::PlannedMessage;

impl fmt::Display for BusPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let us = |ns: u64| format!("{:.1}", ns as f64 / 1e3);
        writeln!(
            f,
            "bus {}: {} bit/s; a cycle of {} µs takes {} µs at worst; load {:.1} %",
            self.bus,
            self.bitrate.bps(),
            us(self.cycle_ns),
            us(self.cycle_time_ns()),
            self.utilisation() * 100.0
        )?;
        write!(
            f,
            "  {:<14} {:>4} {:>5} {:>11} {:>9} {:>9} {:>11} {:>11} {:>11}",
            "message", "id", "bytes", "period, µs", "wire, µs", "jitter", "response", "in all", "deadline"
        )?;
        for planned in &self.messages {
            let PlannedMessage { message, transmission_ns, jitter_ns, response_ns } = planned;
            let bound = |ns: Option<u64>| ns.map_or_else(|| "unbounded".to_owned(), us);
            write!(
                f,
                "\n  {:<14} {:>4} {:>5} {:>11} {:>9} {:>9} {:>11} {:>11} {:>11}{}",
                message.name,
                message.id.to_string(),
                message.data_length,
                us(message.period_ns),
                us(*transmission_ns),
                bound(*jitter_ns),
                bound(*response_ns),
                bound(planned.arrival_ns()),
                us(message.deadline_ns),
                if planned.fits() { "" } else { "  too late" }
            )?;
        }
        Ok(())
    }
}
