//! The study's figures, as SVG.

mod basins;
mod draw;
mod mechanism;
mod rates;
mod solutions;
mod speed;
mod traces;
mod workspace;

use masseter_charts::Error;

use crate::figure::Figure;
use crate::study::Study;

/// All figures, in the order of the page.
pub(super) fn figures(study: &Study) -> Result<Vec<Figure>, Error> {
    let mut figures = traces::figures(&study.pairs)?;
    figures.extend([
        speed::figure(study)?,
        mechanism::assemblies(study)?,
        mechanism::solution_set(study)?,
        solutions::figure(&study.multiplicity)?,
        basins::figure(&study.basins)?,
        rates::figure(&study.trials)?,
    ]);
    figures.extend(workspace::figures(study)?);
    Ok(figures)
}
