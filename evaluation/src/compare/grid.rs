//! Tables for the terminal and for Markdown, of the same cells.

use comfy_table::{Cell, CellAlignment, ColumnConstraint, ContentArrangement, Table, TableComponent, presets};

/// A head and its rows.
pub(crate) struct Grid {
    head: Vec<(String, Side)>,
    rows: Vec<Vec<String>>,
}

/// On which side a column's cells are flush.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    /// Text.
    Left,
    /// Numbers.
    Right,
    /// Text that is broken between words where the table is too wide.
    Words,
    /// A name that is broken at its underscores where the table is too wide.
    Name,
}

impl Grid {
    /// A table of this head, without rows.
    pub(crate) fn new(head: &[(&str, Side)]) -> Self {
        let head = head.iter().map(|(name, side)| ((*name).to_owned(), *side));
        Self { head: head.collect(), rows: Vec::new() }
    }

    /// One more row.
    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    fn table(&self, cell: impl Fn(&str) -> String) -> Table {
        let aligned = |text: &str, side: Side| {
            let alignment = if side == Side::Right { CellAlignment::Right } else { CellAlignment::Left };
            Cell::new(text).set_alignment(alignment)
        };
        let mut table = Table::new();
        table.set_header(self.head.iter().map(|(name, side)| aligned(name, *side)));
        for row in &self.rows {
            table.add_row(row.iter().zip(&self.head).map(|(text, (_, side))| aligned(&cell(text), *side)));
        }
        table.set_content_arrangement(ContentArrangement::Disabled);
        table
    }

    /// For the terminal, in lines that end in a line feed.
    pub(crate) fn text(&self, width: usize) -> String {
        let mut table = self.table(str::to_owned);
        table.load_preset(presets::NOTHING);
        table.set_style(TableComponent::HeaderLines, '─');
        table.set_content_arrangement(ContentArrangement::Dynamic).set_width(width.try_into().unwrap_or(u16::MAX));
        for (column, (_, side)) in table.column_iter_mut().zip(&self.head) {
            column.set_padding((0, 1));
            match side {
                Side::Words => column.set_delimiter(' '),
                Side::Name => column.set_delimiter('_'),
                Side::Left | Side::Right => column.set_constraint(ColumnConstraint::ContentWidth),
            };
        }
        table.lines().map(|line| line.trim_end().to_owned() + "\n").collect()
    }

    /// For a page.
    pub(crate) fn markdown(&self) -> String {
        let mut table = self.table(escaped);
        table.load_preset(presets::ASCII_MARKDOWN);
        format!("{table}\n")
    }
}

/// Text of others, which must neither end its cell nor be taken for a page's own.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '|' | '\\' | '`' | '*' | '[' | ']' | '#' => out.extend(['\\', c]),
            '<' => out.push_str("&lt;"),
            '&' => out.push_str("&amp;"),
            // Nobody is called by a log.
            '@' => out.push_str("&#64;"),
            _ if c.is_control() => out.push(' '),
            _ => out.push(c),
        }
    }
    out
}
