//! How tables look: columns of text, a line under the head, numbers to the right.

use comfy_table::{CellAlignment, Table, presets};

/// An empty table; columns whose head begins with `>` are aligned to the right.
pub fn table(head: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING).set_style(comfy_table::TableComponent::HeaderLines, '─');
    table.set_header(head.iter().map(|name| name.trim_start_matches('>')));
    for (column, name) in table.column_iter_mut().zip(head) {
        column.set_padding((0, 2));
        if name.starts_with('>') {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// `count` things: `1 lane`, `2 lanes`, `no lanes`.
pub fn count(count: usize, thing: &str) -> String {
    match count {
        0 => format!("no {thing}s"),
        1 => format!("1 {thing}"),
        _ => format!("{count} {thing}s"),
    }
}
