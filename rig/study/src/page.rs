//! The page that sets each claim of the paper beside what was measured, in Markdown.

use std::fmt::Write;

use crate::claims::PaperClaim;
use crate::figure::Figure;
use crate::study::Study;

/// The whole page. Every figure has the caption of its drawing; `command` repeats the study.
pub(super) fn text(study: &Study, command: &str, claims: &[PaperClaim], figures: &[Figure]) -> String {
    let mut page = format!(
        "# The paper's claims beside what was measured\n\n\
         The paper describes the 6-DOF mastication mechanism and its forward kinematics; `published` below is its \
         solver as printed (residuals are distances, the increment is halved until the error decreases), with at \
         most 100 iterations and 40 halvings. *From above the base*: {samples} random inputs with one true \
         solution, each with a random guess of leg angles between 0° and 180°. Verdicts follow from the figures of \
         this run by the criterion beside them.\n\n\
         Masseter {version}, random numbers from seed {seed}. To repeat it:\n\n    {command}\n\n\
         Only times differ from run to run.\n\n\
         | # | The paper's claim | Where | Measured | Criterion | Verdict |\n\
         | --- | --- | --- | --- | --- | --- |\n",
        samples = study.settings.samples,
        seed = study.settings.seed,
        version = env!("CARGO_PKG_VERSION"),
    );
    for (index, claim) in claims.iter().enumerate() {
        let figure = claim.figure.map_or(String::new(), |name| format!(" ([figure](#{name}))"));
        let PaperClaim { statement, section, measured, criterion, judgement, .. } = claim;
        let number = index + 1;
        let _ = writeln!(
            page,
            "| {number} | {statement} | {section} | {measured}{figure} | {criterion} | **{}** |",
            judgement.name()
        );
    }
    page += &workspace(study);
    page += "\nNot measured: what the paper says of the Stewart platform, genetic algorithms, friction and dynamics.\n";
    for Figure { name, caption, .. } in figures {
        let _ = write!(page, "\n<a id=\"{name}\"></a>\n\n![{name}]({name}.svg)\n\n{caption}\n");
    }
    page
}

/// How far the platform reaches in each map.
fn workspace(study: &Study) -> String {
    let mut lines =
        "\n## Workspace\n\nReach within the strokes, the other coordinates as at the neutral pose:\n\n\
                     | map | coordinate | from | to |\n| --- | --- | --- | --- |\n"
            .to_owned();
    for map in &study.maps {
        for coordinate in [map.slice.across, map.slice.up] {
            let [from, to] = map.reach(coordinate).map_or_else(
                || ["–".to_owned(), "–".to_owned()],
                |reach| reach.map(|value| format!("{value:.1}")),
            );
            let (name, label) = (map.table_name(), coordinate.label());
            let _ = writeln!(lines, "| [{name}]({name}.csv) | {label} | {from} | {to} |");
        }
    }
    lines
}
