//! The paper study: the forward kinematics of the paper measured again, as data, figures and a page that sets each of the
//! paper's claims beside what was measured. And [`uniqueness`]: a proof that six inputs determine one pose.
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

mod basins;
mod claims;
mod forces;
mod motions;
mod multiplicity;
mod pairs;
mod plot;
mod pressure;
mod sample;
mod share;
mod solution_set;
mod solver;
mod speed;
mod study;
mod table;
mod trials;
pub mod uniqueness;
mod workspace;
mod write;

pub use claims::{ClaimJudgement, PaperClaim};
pub use study::{PreparedStudy, Settings, Study};
pub use write::write;
