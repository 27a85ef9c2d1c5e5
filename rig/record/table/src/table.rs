//! Tables: columns of one length, each with its unit and meaning, and their cells.

use serde::{Deserialize, Serialize};

/// The values of a column; `None` for a row without a value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Values {
    /// Real numbers.
    Numbers(Vec<Option<f64>>),
    /// Whole numbers.
    Whole(Vec<Option<i64>>),
    /// Texts.
    Words(Vec<Option<String>>),
    /// True or false.
    Truths(Vec<Option<bool>>),
}

/// Does the same with the list of any kind of values.
macro_rules! of_any_kind {
    ($values:expr, $list:ident => $result:expr) => {
        match $values {
            Values::Numbers($list) => $result,
            Values::Whole($list) => $result,
            Values::Words($list) => $result,
            Values::Truths($list) => $result,
        }
    };
}

impl Values {
    fn len(&self) -> usize {
        of_any_kind!(self, values => values.len())
    }

    fn clear(&mut self) {
        of_any_kind!(self, values => values.clear());
    }

    fn push_cell(&mut self, cell: Cell) {
        match (self, cell) {
            (Self::Numbers(values), Cell::Number(value)) => values.push(value),
            (Self::Whole(values), Cell::Whole(value)) => values.push(value),
            (Self::Words(values), Cell::Word(value)) => values.push(value),
            (_, cell) => panic!("{cell:?} does not fit its column"),
        }
    }

    /// The value of a row as text with as many digits as give the same number again; empty where there is none.
    pub(crate) fn cell_text(&self, row: usize) -> String {
        of_any_kind!(self, values => values[row].as_ref().map(ToString::to_string).unwrap_or_default())
    }

    /// The kind of values in words.
    fn kind(&self) -> &'static str {
        match self {
            Self::Numbers(_) => "number",
            Self::Whole(_) => "whole number",
            Self::Words(_) => "text",
            Self::Truths(_) => "true or false",
        }
    }
}

/// The value of one row in a column of its kind.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// A real number.
    Number(Option<f64>),
    /// A whole number.
    Whole(Option<i64>),
    /// A text.
    Word(Option<String>),
}

/// A column.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// The unit of its values; empty where they have none.
    pub unit: String,
    /// What its values are.
    pub about: String,
    /// Its values.
    pub values: Values,
}

impl Column {
    /// A column; the unit is empty where the values have none.
    pub fn new(name: &str, unit: &str, about: &str, values: Values) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), about: about.to_owned(), values }
    }
}

/// Columns of one length: a table, or the next rows of a long one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Table {
    columns: Vec<Column>,
}

impl Table {
    /// A table. A second column of the same name gets a number behind the name.
    ///
    /// # Panics
    /// When the columns differ in length.
    pub fn new(columns: Vec<Column>) -> Self {
        let rows = columns.first().map_or(0, |column| column.values.len());
        assert!(columns.iter().all(|column| column.values.len() == rows), "all columns have the same length");
        let mut named: Vec<Column> = Vec::new();
        for mut column in columns {
            let is_taken = |name: &str| named.iter().any(|other| other.name == name);
            if is_taken(&column.name) {
                let others = (2..).map(|number| format!("{} ({number})", column.name));
                column.name = others.into_iter().find(|name| !is_taken(name)).unwrap_or_default();
            }
            named.push(column);
        }
        Self { columns: named }
    }

    /// The columns.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.values.len())
    }

    /// Adds a row.
    ///
    /// # Panics
    /// When the cells are not those of the columns, in number or kind.
    pub fn push(&mut self, row: impl IntoIterator<Item = Cell>) {
        let mut row = row.into_iter();
        for column in &mut self.columns {
            column.values.push_cell(row.next().expect("a row has a cell for each column"));
        }
        assert!(row.next().is_none(), "a row has no more cells than there are columns");
    }

    /// Removes all rows.
    pub fn clear(&mut self) {
        self.columns.iter_mut().for_each(|column| column.values.clear());
    }

    /// The codebook of tables: a row for each of their columns, with its unit, its type and its meaning.
    pub fn codebook<'a>(tables: impl IntoIterator<Item = (&'a str, &'a Self)>) -> Self {
        let columns = [
            ("table", "Name of the table."),
            ("column", "Name of the column."),
            ("unit", "Unit of the values; empty where they have none."),
            ("type", "Type of the values."),
            ("meaning", "What the values are."),
        ];
        let words = |(name, about)| Column::new(name, "", about, Values::Words(Vec::new()));
        let mut codebook = Self::new(columns.map(words).to_vec());
        for (name, table) in tables {
            for Column { name: column, unit, about, values } in &table.columns {
                let row = [name, column, unit, values.kind(), about];
                codebook.push(row.map(|text| Cell::Word(Some(text.to_owned()))));
            }
        }
        codebook
    }
}
