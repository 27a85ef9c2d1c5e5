//! `masseter clean`: removes the shared memory of killed runs. Live runs are not touched.

use masseter_runtime::transport::Domain;
use masseter_scenario::wording::counted;
use masseter_terminal::{Exit, result_line, status};

/// Sweeps every dead domain of this user and lists all domains.
pub(crate) fn clean() -> anyhow::Result<Exit> {
    let domains = Domain::all()?;
    for domain in &domains {
        match domain.sweep()? {
            Some(swept) => {
                result_line!(
                    "{}: {} removed from shared memory",
                    domain.id(),
                    counted(swept.removed as u64, "file")
                )?;
                swept.remaining.iter().for_each(|error| status!("masseter: {error}"));
            }
            None => result_line!("{}: running, not removed", domain.id())?,
        }
    }
    if domains.is_empty() {
        result_line!("nothing to clean")?;
    }
    Ok(Exit::Passed)
}
