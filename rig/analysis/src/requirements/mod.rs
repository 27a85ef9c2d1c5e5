//! Requirements: what must hold in a run, each with its outcome, its margin and the moment of the smallest margin.
//!
//! All are judged in one pass over the samples of the run, in the order of time. `docs/requirements.md` fixes the meaning
//! of windows, missing samples and the run's end. What the outcomes mean for the verdict is the report's.

mod base_exponents;
mod bounds;
mod condition;
mod count;
mod dimension;
mod expression;
mod finding;
mod moment;
mod never;
mod occurrence;
mod order;
mod quantified;
mod refusal;
mod requirement;
mod response;
mod set;
#[cfg(test)]
mod tests;
mod trigger;
mod window;

pub use finding::{RequirementFigures, RequirementPlot, RequirementResult};
pub use occurrence::event_names;
pub use refusal::RequirementError;
pub use set::{Requirements, check_requirements};
