//! The paper study: the forward kinematics of the paper measured again, as data, figures and a page that sets each of
//! the paper's claims beside what was measured. And [`uniqueness`]: a proof that six inputs determine one pose.
//! `masseter-research` is the command to both. No run needs this crate.
//!
//! Both are about the published mechanism, and neither prints: progress goes to a callback. All results but times are a
//! function of the [`Settings`].
//!
//! ```no_run
//! use masseter_research::{Settings, Study, write};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let settings = Settings { seed: 1, samples: 2000, cells: 60 };
//! let study = Study::prepare(None)?.run(settings, |stage| eprintln!("{stage}"))?;
//! for claim in write(&study, "study".as_ref(), "masseter-research study --out DIR")? {
//!     println!("{}: {}", claim.judgement.name(), claim.statement);
//! }
//! # Ok(())
//! # }
//! ```

mod claims;
mod evidence;
mod forces;
mod maps;
mod motions;
mod pairs;
mod plot;
mod solutions;
mod solver;
mod speed;
mod study;
mod trials;
pub mod uniqueness;

use std::fs;
use std::path::Path;

use anyhow::Context;
use askama::Template;

use claims::judged_claims;
pub use evidence::{ClaimJudgement, PaperClaim};
pub use study::{PreparedStudy, Settings, Study};

/// The page that sets each claim of the paper beside what was measured, with the captions of the figures.
#[derive(Template)]
#[template(path = "claims.md", escape = "none")]
struct Page<'a> {
    study: &'a Study,
    /// Repeats the study.
    command: &'a str,
    claims: &'a [PaperClaim],
    version: &'static str,
}

/// Writes tables, figures and `claims.md` into an existing folder, and returns the claims in the paper's order, those
/// about forces last. `command` is what repeats this study, for the page.
///
/// # Errors
/// When a file cannot be written.
pub fn write(study: &Study, folder: &Path, command: &str) -> anyhow::Result<Vec<PaperClaim>> {
    let keep = |name: &str, extension: &str, text: &str| {
        let path = folder.join(name).with_extension(extension);
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
    };
    let figures = plot::figures(study).context("cannot draw the figures")?;
    for (name, table) in tables(study) {
        keep(name, "csv", &table)?;
    }
    for (name, svg) in &figures {
        keep(name, "svg", svg)?;
    }
    for figure in &study.forces.figures {
        keep(figure.name, "svg", &figure.svg)?;
    }
    let claims = [judged_claims(study), study.forces.claims.clone()].concat();
    let version = env!("CARGO_PKG_VERSION");
    keep("claims", "md", &Page { study, command, claims: &claims, version }.render()?)?;
    Ok(claims)
}

fn tables(study: &Study) -> Vec<(&'static str, String)> {
    let mut tables = vec![
        ("success", study.trials.success_table()),
        ("iterations", study.trials.iterations_table()),
        ("cost", study.trials.cost_table()),
        ("speed", speed::table(&study.speed)),
        ("fig8_solutions", study.set.table()),
        ("multiplicity", study.multiplicity.table()),
        ("basins", study.basins.table()),
        ("motions", motions::table(&study.motions, &study.mechanism)),
    ];
    tables.extend(study.pairs.iter().map(|one| (one.name, one.table())));
    tables.extend(study.maps.iter().map(|map| (map.slice.name, map.table())));
    tables
}
