//! Keeps tables readable: no cell is long.

/// Longest cell of a table, in characters. People do not read longer cells.
pub const CELL: usize = 160;

/// Splits a text: the sentences that a cell has room for, and the rest.
fn split(text: &str) -> (&str, &str) {
    let ends = text.match_indices(". ").map(|(at, _)| at + 1).chain([text.len()]);
    // A first sentence that is too long stays whole, so that the test reports it.
    let at = ends.take_while(|at| text[..*at].chars().count() <= CELL).last();
    text.split_at(at.unwrap_or(text.len()))
}

/// For each row whose last cell is too long, moves the rest of the cell to a list behind the table.
pub fn shorten(page: &str) -> String {
    let (mut text, mut more) = (String::new(), String::new());
    for line in page.lines() {
        let cells: Vec<&str> = line.split('|').collect();
        let is_row = line.starts_with('|') && cells.len() > 3;
        if !is_row && !more.is_empty() {
            text += &format!("\nMore about these:\n\n{more}");
            more.clear();
        }
        match (is_row, is_row.then(|| split(cells[cells.len() - 2].trim()))) {
            (true, Some((cell, rest))) if !rest.is_empty() => {
                let before = &cells[..cells.len() - 2];
                text += &format!("{}| {cell} |\n", before.join("|"));
                more += &format!("- {}: {}\n", cells[1].trim(), rest.trim());
            }
            _ => text += &format!("{line}\n"),
        }
    }
    text
}
