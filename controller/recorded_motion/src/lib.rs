//! Recorded motions of the lower jaw: a tracker's file is read, judged, and made a smooth curve.
//!
//! [`import`] reads a file or refuses it, [`survey`] describes the file, and [`recorded_signals`] are its other columns.
//! Whether the mechanism can follow the motion is not judged here. A file is read once, before a run. Only
//! [`Recording`] is evaluated in each cycle, without allocation and without iteration.

mod c3d;
mod columns;
mod doubts;
mod error;
mod extras;
mod frames;
mod import;
mod jaw;
mod layout;
mod markers;
mod plausible;
mod recording;
mod row;
mod sheet;
mod signals;
mod survey;
mod table;
mod units;

pub use doubts::Glitch;
pub use error::{TrajectoryError, ranges_of, require};
pub use frames::{Frame, Frames};
pub use import::plain_form;
pub use jaw::{condylar_middle, points_in_jaw_frame};
pub use plausible::{Implausible, import};
pub use recording::Recording;
pub use signals::{RecordedSignal, recorded_signals};
pub use survey::{Gap, PointFigures, Range, RecordingSurvey, StepFigures, SurveyRow, survey};
pub use units::Unit;
