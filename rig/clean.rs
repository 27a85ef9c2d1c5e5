//! `masseter clean`: removes what killed runs left behind. Runs that live are not touched.

use masseter_shared::transport::{Domain, DomainError};

use masseter_terminal::{Exit, result_line};

/// Sweeps every dead domain of this user and says what was found.
pub(crate) fn clean() -> anyhow::Result<Exit> {
    let domains = Domain::all()?;
    for domain in &domains {
        match domain.sweep()? {
            Some(files) => result_line!("{}: {files} files removed from shared memory", domain.id())?,
            None => result_line!("{}: running, left alone", domain.id())?,
        }
    }
    if domains.is_empty() {
        result_line!("nothing to clean")?;
    }
    Ok(Exit::Passed)
}

/// Sweeps dead domains before a run, silently.
pub(crate) fn sweep_dead() -> Result<(), DomainError> {
    Domain::all()?.iter().try_for_each(|domain| domain.sweep().map(drop))
}
