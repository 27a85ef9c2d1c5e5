//! `masseter clean`: removes what killed runs left behind. Runs that live are not touched.

use masseter_shared::transport::{Domain, DomainError};

use crate::exit::{Exit, Failure};

/// Sweeps every dead domain of this user and says what was found.
pub(crate) fn clean() -> Result<Exit, Failure> {
    let mut swept = 0;
    for domain in Domain::all()? {
        if domain.is_alive() {
            println!("{}: running, left alone", domain.id());
        } else {
            println!("{}: {} files removed from shared memory", domain.id(), domain.sweep()?);
            swept += 1;
        }
    }
    if swept == 0 {
        println!("nothing to clean");
    }
    Ok(Exit::Passed)
}

/// Sweeps dead domains before a run, silently.
pub(crate) fn sweep_dead() -> Result<(), DomainError> {
    for domain in Domain::all()?.iter().filter(|domain| !domain.is_alive()) {
        domain.sweep()?;
    }
    Ok(())
}
