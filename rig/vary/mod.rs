//! One scenario in many variants, or many scenarios: suite, campaign, search, shrinking, storms, causes, and the matrix of
//! faults.
//! All of them play their runs by the [`Runner`](crate::run::runner::Runner); their verbs are in [`cli`](crate::cli).

pub(crate) mod identify;
pub(crate) mod matrix;
pub(crate) mod play;
pub(crate) mod search;
pub(crate) mod shrink;
pub(crate) mod storm;
pub(crate) mod suite;
pub(crate) mod why;
