//! Rigs of this user: those that run, and what dead ones left in shared memory.

use masseter_shared::transport::{Domain, DomainError};

use super::finding::Finding;

/// All findings of this family.
pub(super) fn examine() -> Vec<Finding> {
    vec![leftovers(&alive_and_dead())]
}

fn alive_and_dead() -> Result<(usize, usize), DomainError> {
    let alive = Domain::all()?.iter().map(Domain::is_alive).collect::<Result<Vec<_>, _>>()?;
    let count = |wanted: bool| alive.iter().filter(|&&is_alive| is_alive == wanted).count();
    Ok((count(true), count(false)))
}

fn leftovers(count: &Result<(usize, usize), DomainError>) -> Finding {
    const CHECK: &str = "other rigs";
    match count {
        Ok((0, 0)) => Finding::ok(CHECK, "none runs, none left anything behind"),
        Ok((alive, 0)) => {
            Finding::warn(CHECK, format!("{alive} running"), "rigs on the same cores delay each other")
                .mended_by("masseter run --cores N,N")
        }
        Ok((alive, dead)) => Finding::warn(
            CHECK,
            format!("{alive} running, {dead} dead ones left files behind"),
            "their shared memory is not free until they are swept",
        )
        .mended_by("masseter clean"),
        Err(error) => Finding::warn(CHECK, error.to_string(), "what killed runs left cannot be swept"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dead_rigs_are_swept_and_living_ones_avoided() {
        let mend = |alive, dead| leftovers(&Ok((alive, dead))).mend;
        assert_eq!(mend(0, 0), None);
        assert!(mend(1, 0).unwrap().contains("--cores"));
        assert_eq!(mend(1, 2).as_deref(), Some("masseter clean"));
    }
}
