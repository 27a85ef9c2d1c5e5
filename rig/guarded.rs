//! A run whose panic is its own failure: the other runs of a suite or campaign go on.

use std::panic::{self, AssertUnwindSafe};

use masseter_terminal::{Exit, Failure};

/// Runs one scenario; a panic is its failure.
pub(crate) fn guarded<T>(run: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    // What it leaves half done belongs to this scenario alone.
    panic::catch_unwind(AssertUnwindSafe(run)).unwrap_or_else(|payload| {
        let texts = [payload.downcast_ref::<String>().map(String::as_str), payload.downcast_ref().copied()];
        let why = texts.into_iter().flatten().next().unwrap_or("it gave no message");
        let error = anyhow::anyhow!("DIED: the rig panicked: {why}: report this as a defect of masseter");
        Err(Failure::with(Exit::Died, error))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_the_failure_of_its_scenario() {
        let said = |run: fn() -> Result<u8, Failure>| guarded(run).unwrap_err().error.to_string();
        assert!(said(|| panic!("of {}", 3)).starts_with("DIED: the rig panicked: of 3: "));
        assert!(said(|| panic!("plain")).starts_with("DIED: the rig panicked: plain: "));
        assert!(said(|| panic::panic_any(7)).contains("it gave no message"));
        assert_eq!(guarded(|| Ok(1)).ok(), Some(1));
    }
}
