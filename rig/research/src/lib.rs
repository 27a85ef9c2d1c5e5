//! The paper study: the forward kinematics of the paper measured again, as tables. `scripts/study.py` sets each of the paper's
//! claims beside the measurements, and draws the figures. And [`uniqueness`]: a proof that six inputs determine one pose.
//! `masseter-research` is the command to both. No run needs this crate.
//!
//! Both are about the published mechanism, and neither prints: progress goes to a callback. All results but times are a
//! function of the [`Settings`].
//!
//! ```no_run
//! use masseter_research::{Settings, Study};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let settings = Settings { seed: 1, samples: 2000, cells: 60 };
//! for (name, table) in Study::prepare(None)?.run(settings, |stage| eprintln!("{stage}"))? {
//!     println!("{name}: {} lines", table.lines().count());
//! }
//! # Ok(())
//! # }
//! ```

mod enclosure;
mod forces;
mod maps;
mod motions;
mod pairs;
mod proof;
mod solutions;
mod solver;
mod speed;
mod study;
mod tables;
mod trials;
pub mod uniqueness;

pub use study::{Settings, Study};
