//! The one page of all results: of a finished run, a run that goes on, a suite, a campaign, a comparison.
//!
//! The page is a list of sections, and a section a list of blocks. This crate fixes what a block may be and holds the scripts
//! that draw the blocks in a browser. Which figures the page shows is decided by its users. Nothing is fetched.
//!
//! Times in the page's data are seconds since the run's first SYNC; [`Time`] is where the motion began.
//!
//! ```
//! use masseter_page::{Block, Chart, Life, Page, Points, Section, Series, Style, Time};
//!
//! let step = Series::new("slide 1", Style::Plain, Points::over_time(&[(0.0, 0.0), (0.1, 4.0), (0.2, 5.0)]));
//! let chart = Chart { series: vec![step], ..Chart::over_time("Step response", "mm") };
//! let section = Section::new("response", "Response", vec![Block::chart("step", chart)]);
//! let page = Page { sections: vec![section], ..Page::new("a step", Life::Finished, Time::default()) };
//! assert!(page.to_html()?.contains("Step response"));
//! # Ok::<(), masseter_page::PageError>(())
//! ```

mod block;
mod chart;
mod margins;
mod page;

pub use block::{
    Block, Cell, Column, Content, EventRow, Events, Live, Pressure, Section, Table, Tone, Tooth, Verdict,
};
pub use chart::{
    Across, Chart, Dot, LevelKind, Limit, Moment, MomentKind, Phase, Points, Scale, Series, Style, Time,
};
pub use margins::margin_histogram;
pub use page::{Life, Page, PageError};
