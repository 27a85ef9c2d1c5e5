//! The files of the study: tables as CSV, figures as SVG, and the page of claims.

use std::fs;
use std::path::Path;

use anyhow::Context;
use askama::Template;

use crate::claims::{self, PaperClaim};
use crate::study::Study;
use crate::{motions, plot, speed};

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

impl Study {
    /// Writes tables, figures and `claims.md` into an existing folder, and returns the claims in the paper's order.
    /// `command` is what repeats this study, for the page.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, folder: &Path, command: &str) -> anyhow::Result<Vec<PaperClaim>> {
        let write = |name: &str, extension: &str, text: &str| {
            let path = folder.join(name).with_extension(extension);
            fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
        };
        let figures = plot::figures(self).context("cannot draw the figures")?;
        for (name, table) in self.tables() {
            write(name, "csv", &table)?;
        }
        for (name, svg) in &figures {
            write(name, "svg", svg)?;
        }
        let claims = claims::judge(self);
        let version = env!("CARGO_PKG_VERSION");
        write("claims", "md", &Page { study: self, command, claims: &claims, version }.render()?)?;
        Ok(claims)
    }

    fn tables(&self) -> Vec<(&'static str, String)> {
        let mut tables = vec![
            ("success", self.trials.success_table()),
            ("iterations", self.trials.iterations_table()),
            ("cost", self.trials.cost_table()),
            ("speed", speed::table(&self.speed)),
            ("fig8_solutions", self.set.table()),
            ("multiplicity", self.multiplicity.table()),
            ("basins", self.basins.table()),
            ("motions", motions::table(&self.motions, &self.mechanism)),
        ];
        tables.extend(self.pairs.iter().map(|one| (one.name, one.table())));
        tables.extend(self.maps.iter().map(|map| (map.slice.name, map.table())));
        tables
    }
}
