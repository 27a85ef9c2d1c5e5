//! Columns of one length.

use std::io::{self, Read};

use crate::column::{Cell, Column, Values};

/// Columns of one length: a table, or the next rows of a long one.
#[derive(Debug, Clone, PartialEq)]
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
            column.push(row.next().expect("a row has a cell for each column"));
        }
        assert!(row.next().is_none(), "a row has no more cells than there are columns");
    }

    /// Removes all rows.
    pub fn clear(&mut self) {
        self.columns.iter_mut().for_each(Column::clear);
    }

    /// Takes the values of so many rows in place of its own.
    pub(crate) fn receive(&mut self, count: u64, from: &mut impl Read) -> io::Result<()> {
        self.clear();
        self.columns.iter_mut().try_for_each(|column| column.values.receive(count, from))
    }

    /// The codebook of tables: a row for each of their columns, with its unit, its type and its meaning.
    pub fn codebook<'a>(tables: impl IntoIterator<Item = (&'a str, &'a Self)>) -> Self {
        let none = || Values::Words(Vec::new());
        let mut codebook = Self::new(vec![
            Column::new("table", "", "Name of the table.", none()),
            Column::new("column", "", "Name of the column.", none()),
            Column::new("unit", "", "Unit of the values; empty where they have none.", none()),
            Column::new("type", "", "Type of the values.", none()),
            Column::new("meaning", "", "What the values are.", none()),
        ]);
        for (name, table) in tables {
            for Column { name: column, unit, about, values } in &table.columns {
                let row = [name, column, unit, values.kind(), about];
                codebook.push(row.map(|text| Cell::Word(Some(text.to_owned()))));
            }
        }
        codebook
    }
}
