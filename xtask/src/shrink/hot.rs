//! Which code is hot: it stays as the compiler made it.
//!
//! A row is the beginning of names, up to the end of a word: a folder, a module, a type or a function. Shared code costs 10 to
//! 25 cycles wherever it is shared, so that what runs for each step, segment, block or usual line of G-code is here. The example
//! `lines` of `tests/sim` prints what a line of a job costs, by function. `cargo xtask size` fails when a row names nothing any
//! more.

/// Beginnings of the names of hot functions.
pub const ROWS: &[&str] = &[
    // Every interrupt, and what they call.
    "__vector_",
    "kerf::hal::",
    // The executors and their tick.
    "avr_embassy::",
    "embassy_executor::",
    "embassy_time::",
    "kerf::image::",
    // Each segment.
    "kerf::dda::",
    "kerf::motion::",
    "kerf::tasks::exec::",
    // Each hold.
    "kerf::tasks::control::",
    "kerf::tasks::hold::",
    "kerf::machine::",
    // Each line.
    "kerf::tasks::reader::",
    "kerf::tasks::lines::",
    "kerf::tasks::overtake::",
    "kerf::tasks::parser::",
    "kerf::tasks::ports::",
    "kerf::tasks::tx::",
    "kerf::tasks::wake::",
    "kerf::gcode::",
    "kerf::store::",
    "kerf::protocol::tinyg::block::put_brief",
    "kerf::protocol::tinyg::control::",
    "kerf::protocol::tinyg::write::",
    // Each block.
    "kerf::tasks::planner::run::",
    "kerf::tasks::planner::Planner>::announce",
    "kerf::tasks::planner::Planner>::begin",
    "kerf::tasks::planner::Planner>::carry_out_at_once",
    "kerf::tasks::planner::Planner>::line",
    "kerf::tasks::planner::Planner>::part",
    "kerf::tasks::planner::Planner>::push",
    "kerf::tasks::planner::Planner>::replan",
    "kerf::tasks::planner::Planner>::straight",
    "kerf::tasks::planner::Planner>::turn",
    // Woken by all of these.
    "kerf::tasks::reporter::run::",
    "kerf::tasks::reporter::State>::now",
    "kerf::tasks::reporter::tell",
    "kerf::tasks::view::View>::modal",
    "kerf::tasks::view::View>::of",
    "kerf::tasks::view::View>::seen",
    "kerf::tasks::common::snapshot",
    "kerf::tasks::power::",
    "kerf::motors::Motors>::pass",
    "kerf::config::number::Fixed>::render",
    // Small, and called from everywhere.
    "memcpy",
    "memset",
    "core::",
];

/// Whether a function of this name is hot.
pub fn is_hot(name: &str) -> bool {
    ROWS.iter().any(|row| begins(name, row))
}

/// The rows that no function is named by.
pub fn stale<'a>(names: impl Iterator<Item = &'a str> + Clone) -> Vec<&'static str> {
    let stale = |row: &&&str| !names.clone().any(|name| begins(name, row));
    ROWS.iter().filter(stale).copied().collect()
}

/// `<kerf::motion::exec::Exec>::run` begins with `kerf::motion::`, and its poll with what the task is called.
fn begins(name: &str, row: &str) -> bool {
    const POLL: &str = "<embassy_executor::raw::TaskStorage<";
    let name = name.strip_prefix(POLL).unwrap_or(name).trim_start_matches(['<', '&']);
    let is_open = row.ends_with([':', '_']);
    name.strip_prefix(row).is_some_and(|rest| {
        is_open || !rest.starts_with(|next: char| next.is_alphanumeric() || next == '_')
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_names_what_begins_with_it() {
        for name in [
            "<kerf::motion::exec::Exec>::run",
            "kerf::motion::path::norm",
            "__vector_17",
            "<&kerf::motion::x::X as Y>::z",
        ] {
            assert!(is_hot(name), "{name}");
        }
        assert!(is_hot(
            "<embassy_executor::raw::TaskStorage<kerf::tasks::exec::run::{closure#0}>>::poll"
        ));
        assert!(is_hot("<kerf::tasks::planner::Planner>::begin"));
        for name in [
            "<kerf::tasks::planner::Planner>::begin_arc",
            "kerf::protocol::tinyg::json::check",
            "kerf::protocol::f::<kerf::motion::exec::Exec>",
            "main",
        ] {
            assert!(!is_hot(name), "{name}");
        }
    }

    #[test]
    fn a_row_that_names_nothing_is_stale() {
        let names = ["<kerf::motion::exec::Exec>::run"];
        let stale = stale(names.iter().copied());
        assert!(!stale.contains(&"kerf::motion::"));
        assert!(stale.contains(&"__vector_"));
    }
}
