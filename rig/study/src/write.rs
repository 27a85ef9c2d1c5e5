//! The files of the study: tables as CSV, figures as SVG, and the page of claims.

use std::fs;
use std::path::Path;

use anyhow::Context;

use crate::claims::{self, PaperClaim};
use crate::study::Study;
use crate::table::Table;
use crate::workspace::Map;
use crate::{motions, page, plot};

impl Study {
    /// Writes tables, figures and `claims.md` into an existing folder, and returns the claims in the paper's order.
    /// `command` is what repeats this study, for the page.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, folder: &Path, command: &str) -> anyhow::Result<Vec<PaperClaim>> {
        let write = |name: &str, text: &str| {
            fs::write(folder.join(name), text)
                .with_context(|| format!("cannot write {}", folder.join(name).display()))
        };
        let figures = plot::figures(self).context("cannot draw the figures")?;
        for table in self.tables() {
            let failed = || format!("cannot write {}", folder.join(table.name).display());
            table.write(folder).with_context(failed)?;
        }
        for figure in &figures {
            write(&format!("{}.svg", figure.name), &figure.svg)?;
        }
        let claims = claims::judge(self);
        write("claims.md", &page::text(self, command, &claims, &figures))?;
        Ok(claims)
    }

    fn tables(&self) -> Vec<Table> {
        let mut tables = self.pairs.tables();
        tables.extend([
            self.trials.success_table(),
            self.trials.iterations_table(),
            self.trials.cost_table(),
            self.speed.table(),
            self.set.table(),
            self.multiplicity.table(),
            self.basins.table(),
            motions::table(&self.motions, &self.mechanism),
        ]);
        tables.extend(self.maps.iter().map(Map::table));
        tables
    }
}
