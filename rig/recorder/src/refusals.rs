//! Refused peers of a server: counted, and said at most once a second, however many come.

use masseter_runtime::clock::SECOND_NS;

/// Refusals since the last line about them.
#[derive(Debug)]
pub struct Refusals {
    one: String,
    several: String,
    count: u64,
    last: String,
    said_ns: Option<u64>,
}

impl Refusals {
    /// None so far. `one` begins the line about one peer; `several` follows the number of more.
    pub fn new(one: String, several: String) -> Self {
        Self { one, several, count: 0, last: String::new(), said_ns: None }
    }

    /// Counts a refusal.
    pub fn count(&mut self, reason: String) {
        self.count += 1;
        self.last = reason;
    }

    /// The line about the refusals since the last one; none without any, and within a second after that.
    pub fn line(&mut self, now_ns: u64) -> Option<String> {
        let is_time = self.said_ns.is_none_or(|said_ns| now_ns >= said_ns.saturating_add(SECOND_NS));
        if self.count == 0 || !is_time {
            return None;
        }
        let Self { one, several, count, last, .. } = &*self;
        let line = match count {
            1 => format!("{one}: {last}"),
            _ => format!("masseter: {count} {several}, the last one: {last}"),
        };
        (self.count, self.said_ns) = (0, Some(now_ns));
        Some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thousand_refusals_are_two_lines() {
        let mut refusals = Refusals::new("one is refused".to_owned(), "are refused".to_owned());
        assert_eq!(refusals.line(0), None);
        let lines = (0..1000).filter_map(|number| {
            refusals.count(format!("reason {number}"));
            refusals.line(number * SECOND_NS / 1000)
        });
        assert_eq!(lines.collect::<Vec<_>>(), ["one is refused: reason 0"]);
        let last = refusals.line(SECOND_NS).unwrap();
        assert_eq!(last, "masseter: 999 are refused, the last one: reason 999");
    }
}
