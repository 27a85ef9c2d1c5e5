//! Other rigs of this user: running ones, and files of killed ones in shared memory.

use masseter_runtime::transport::{Domain, DomainError};
use masseter_scenario::wording::counted;

use super::finding::Finding;

/// All findings of this family.
pub(super) fn examine() -> Vec<Finding> {
    vec![leftovers(&count_rigs())]
}

/// Running and killed ones.
fn count_rigs() -> Result<[usize; 2], DomainError> {
    let alive = Domain::all()?.iter().map(Domain::is_alive).collect::<Result<Vec<_>, _>>()?;
    Ok([true, false].map(|wanted| alive.iter().filter(|&&is_alive| is_alive == wanted).count()))
}

fn leftovers(count: &Result<[usize; 2], DomainError>) -> Finding {
    const CHECK: &str = "other rigs";
    match count {
        Ok([0, 0]) => Finding::ok(CHECK, "none running, no files of killed ones"),
        Ok([alive, 0]) => {
            Finding::warn(CHECK, format!("{alive} running"), "rigs on the same cores delay each other")
                .with_remedy("masseter run --cores N,N")
        }
        Ok([alive, dead]) => Finding::warn(
            CHECK,
            format!("{alive} running, files of {}", counted(*dead as u64, "killed one")),
            "these files occupy shared memory",
        )
        .with_remedy("masseter clean"),
        Err(error) => Finding::warn(CHECK, error.to_string(), "files of killed runs cannot be removed"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dead_rigs_are_swept_and_living_ones_avoided() {
        let remedy = |alive, dead| leftovers(&Ok([alive, dead])).remedy;
        assert_eq!(remedy(0, 0), None);
        assert!(remedy(1, 0).unwrap().contains("--cores"));
        assert_eq!(remedy(1, 2).as_deref(), Some("masseter clean"));
    }
}
