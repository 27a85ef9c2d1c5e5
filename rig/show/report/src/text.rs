//! Numbers, tables and links as text, for the terminal and the page.

use std::fmt::Display;
use std::path::{Component, Path, PathBuf, absolute};

use masseter_scenario::Dimension;

/// A dash where there is no such figure.
pub(crate) fn or_dash<T>(figure: Option<T>, format: impl Fn(T) -> String) -> String {
    figure.map_or_else(|| "–".to_owned(), format)
}

/// Millimetres or degrees, with four decimals.
pub(crate) fn decimals(value: f64) -> String {
    format!("{value:.4}")
}

/// A number with four significant digits.
pub(crate) fn significant(value: f64) -> String {
    Dimension::One.si_unit().text(value)
}

/// Nanoseconds as microseconds with two decimals.
pub(crate) fn microseconds(ns: u64) -> String {
    format!("{:.2}", ns as f64 / 1e3)
}

/// [`microseconds`], or a dash.
pub(crate) fn us(ns: Option<u64>) -> String {
    or_dash(ns, microseconds)
}

/// Millimetres with four decimals, or a dash.
pub(crate) fn mm(value: Option<f64>) -> String {
    or_dash(value, |mm| format!("{} mm", decimals(mm)))
}

/// A table with columns of these widths, the first to the left, the others to the right.
pub(crate) fn table<const N: usize>(
    widths: [usize; N],
    heads: [&str; N],
    rows: impl IntoIterator<Item = [String; N]>,
) -> String {
    let rows: String = rows.into_iter().map(|row| columns(widths, row)).collect();
    columns(widths, heads) + &rows
}

fn columns<const N: usize>(widths: [usize; N], cells: [impl Display; N]) -> String {
    let cells = widths.into_iter().zip(cells).enumerate().map(|(place, (width, cell))| match place {
        0 => format!("{cell:<width$}"),
        _ => format!(" {cell:>width$}"),
    });
    cells.collect::<String>() + "\n"
}

/// The link from a page to a file; none where the working folder is gone.
pub(crate) fn seen_from(page: &Path, file: &Path) -> Option<String> {
    let [page, file] = [absolute(page).ok()?, absolute(file).ok()?];
    let folder = page.parent()?;
    let shared = folder.components().zip(file.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(shared).map(|_| Component::ParentDir);
    let way: PathBuf = up.chain(file.components().skip(shared)).collect();
    Some(way.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_linked_from_the_folder_of_the_page() {
        for (page, file, expected) in [
            ("suite.html", "kept/bad/report.html", "kept/bad/report.html"),
            ("out/pages/suite.html", "kept/report.html", "../../kept/report.html"),
            ("/a/b/suite.html", "/a/c/report.html", "../c/report.html"),
        ] {
            assert_eq!(seen_from(page.as_ref(), file.as_ref()).as_deref(), Some(expected));
        }
    }
}
