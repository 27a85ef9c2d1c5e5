//! The study's figures, as SVG. Their captions stand in the template of the page.

mod basins;
mod colours;
mod mechanism;
mod rates;
mod solutions;
mod speed;
mod traces;
mod workspace;

use masseter_charts::Error;

use crate::study::Study;

/// All figures with their names.
pub(super) fn figures(study: &Study) -> Result<Vec<(&'static str, String)>, Error> {
    let mut figures = vec![
        ("fig5_speed", speed::svg(study)?),
        ("fig6_assemblies", mechanism::assemblies(study)?),
        ("fig8_solutions", mechanism::solution_set(study)?),
        ("multiplicity", solutions::svg(&study.multiplicity)?),
        ("basins", basins::svg(&study.basins)?),
        ("success", rates::svg(&study.trials)?),
    ];
    for pair in &study.pairs {
        figures.push((pair.name, traces::svg(pair)?));
    }
    figures.extend(workspace::figures(study)?);
    Ok(figures)
}
