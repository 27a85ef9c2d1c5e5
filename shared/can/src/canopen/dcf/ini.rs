//! The layer of sections and keys, with the line of each. A crate for INI files would lose the lines.

use std::collections::HashMap;

use super::error::{DcfError, Problem};

/// A section and its keys; names are compared without regard to case.
#[derive(Debug)]
pub(super) struct Section<'a> {
    pub(super) name: &'a str,
    pub(super) line: usize,
    keys: HashMap<String, Field<'a>>,
}

/// The value of a key.
#[derive(Debug, Clone, Copy)]
pub(super) struct Field<'a> {
    pub(super) text: &'a str,
    pub(super) line: usize,
}

impl<'a> Section<'a> {
    /// All sections of a text, in its order.
    pub(super) fn read_all(text: &'a str) -> Result<Vec<Self>, DcfError> {
        let mut sections: Vec<Self> = Vec::new();
        let mut first_lines = HashMap::new();
        let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
        for (line, content) in (1..).zip(text.lines().map(str::trim)) {
            if content.is_empty() || content.starts_with([';', '#']) {
                continue;
            }
            if let Some(name) = content.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
                let name = name.trim();
                if let Some(first) = first_lines.insert(name.to_ascii_lowercase(), line) {
                    return Err(Problem::SecondSection { section: name.to_owned(), first }.at(line));
                }
                sections.push(Self { name, line, keys: HashMap::new() });
                continue;
            }
            let Some((key, value)) = content.split_once('=') else {
                return Err(Problem::NoEntry { text: content.to_owned() }.at(line));
            };
            let (key, text) = (key.trim(), value.trim());
            let Some(section) = sections.last_mut() else {
                return Err(Problem::OutsideSections { key: key.to_owned() }.at(line));
            };
            let former = section.keys.insert(key.to_ascii_lowercase(), Field { text, line });
            if let Some(Field { line: first, .. }) = former {
                return Err(Problem::SecondKey { key: key.to_owned(), first }.at(line));
            }
        }
        Ok(sections)
    }

    /// The value of a key; none if it is absent or empty.
    pub(super) fn get(&self, key: &str) -> Option<Field<'a>> {
        self.keys.get(&key.to_ascii_lowercase()).copied().filter(|field| !field.text.is_empty())
    }

    /// The value of a key that the section needs.
    pub(super) fn require(&self, key: &'static str) -> Result<Field<'a>, DcfError> {
        let missing = || Problem::Missing { section: self.name.to_owned(), key }.at(self.line);
        self.get(key).ok_or_else(missing)
    }
}
