//! The page as a whole, and as HTML.

use askama::Template;
use serde::Serialize;

use crate::block::Section;
use crate::chart::{Moment, Phase, Time};

/// Whether the run is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Life {
    /// It is, and the page holds everything.
    Finished,
    /// It goes on, and a script of the live view adds points and changes blocks.
    Live,
}

/// A page.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Page {
    /// The heading.
    pub title: String,
    /// A line below the heading.
    pub about: String,
    /// Whether the run is over.
    pub life: Life,
    /// What times count from.
    pub time: Time,
    /// What all charts over time mark.
    pub moments: Vec<Moment>,
    /// The window that the page opens at, s since the first SYNC; the whole run where there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window: Option<[f64; 2]>,
    /// The controller's states, one after the other.
    pub phases: Vec<Phase>,
    /// In their order.
    pub sections: Vec<Section>,
}

/// Why a page could not be made.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// The data are no JSON.
    #[error("cannot write the page's data: {0}")]
    Data(#[from] serde_json::Error),
    /// The frame of the page cannot be filled.
    #[error("cannot fill the page's frame: {0}")]
    Frame(#[from] askama::Error),
}

/// The scripts in the order in which they need each other. The last one builds the page.
const SCRIPTS: [&str; 14] = [
    include_str!("../assets/base.js"),
    include_str!("../assets/points.js"),
    include_str!("../assets/axis.js"),
    include_str!("../assets/clock.js"),
    include_str!("../assets/export.js"),
    include_str!("../assets/gestures.js"),
    include_str!("../assets/chart.js"),
    include_str!("../assets/blocks.js"),
    include_str!("../assets/pressure.js"),
    include_str!("../assets/solid.js"),
    include_str!("../assets/scene.js"),
    include_str!("../assets/jaw.js"),
    include_str!("../assets/live.js"),
    include_str!("../assets/page.js"),
];

#[derive(Template)]
#[template(path = "page.html")]
struct Html<'a> {
    title: &'a str,
    style: &'a str,
    script: &'a str,
    data: &'a str,
}

impl Page {
    /// Without sections yet.
    #[must_use]
    pub fn new(title: &str, life: Life, time: Time) -> Self {
        Self {
            title: title.to_owned(),
            about: String::new(),
            life,
            time,
            moments: Vec::new(),
            window: None,
            phases: Vec::new(),
            sections: Vec::new(),
        }
    }

    /// The page as one file.
    ///
    /// # Errors
    /// Where the data cannot be written.
    pub fn to_html(&self) -> Result<String, PageError> {
        let json = serde_json::to_string(self)?;
        // No text can end the element that holds the data.
        let data = json.replace('<', "\\u003c");
        let html = Html {
            title: &self.title,
            style: include_str!("../assets/style.css"),
            script: &SCRIPTS.concat(),
            data: &data,
        };
        Ok(html.render()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Block, Content};

    #[test]
    fn no_text_of_the_data_is_markup() {
        let text = Block::new("note", Content::Text("</script><b>".to_owned()));
        let sections = vec![Section::new("all", "All", vec![text])];
        let page = Page { sections, ..Page::new("a <b>", Life::Finished, Time::default()) };
        let html = page.to_html().unwrap();
        assert!(!html.contains("</script><b>") && !html.contains("a <b>"));
        assert!(html.contains(r"\u003c/script>\u003cb>"));
    }

    #[test]
    fn no_script_ends_its_element_and_nothing_is_fetched() {
        for script in SCRIPTS {
            assert!(
                !script.contains("</script") && !script.contains("fetch(") && !script.contains("import ")
            );
        }
    }
}
