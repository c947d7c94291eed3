//! Which code is hot: it stays as the compiler made it.
//!
//! A row is the beginning of names, up to the end of a word: a folder, a module, a type or a function. Of the rows that a name begins with the
//! longest says whether it is hot. Shared code costs 10 to 25 cycles wherever it is shared, so that what runs for each step, segment, block
//! or usual line of G-code is hot.
//!
//! The rows come from counts: `KERF_COUNTS=FOLDER cargo xtask bench` writes how often each instruction ran. A function is cold if sharing
//! would cost less than 0.02 % of the time of any job of the bench, 25 cycles each time it is called and 6 % of what it takes itself; half
//! of that in `kerf::motion`. `cargo xtask size` fails when a row names nothing any more.

/// Beginnings of the names of hot functions.
pub const HOT: &[&str] = &[
    // Every interrupt, the executors and their tick.
    "__vector_",
    "kerf::hal::",
    "avr_embassy::",
    "embassy_executor::",
    "embassy_time::",
    "kerf::image::",
    "kerf::dda::",
    // Small, and called from everywhere.
    "memcpy",
    "memset",
    "core::",
    // What runs for each segment, block, line or report.
    "kerf::config::Settings>::derive",
    "kerf::config::Settings>::get",
    "kerf::config::Settings>::put",
    "kerf::config::Settings>::put_row",
    "kerf::config::Settings>::set",
    "kerf::config::name::Name>::with",
    "kerf::config::name::Name>::with_token",
    "kerf::config::number::Fixed>::render",
    "kerf::config::number::Fixed>::rounded",
    "kerf::config::ratio::StepRatio>::octaves",
    "kerf::config::setting::",
    "kerf::gcode::arc::Walk>::next",
    "kerf::gcode::block::Block>::",
    "kerf::gcode::command::Commands>::is_motion_alone",
    "kerf::gcode::interpreter::Interpreter",
    "kerf::gcode::lexer::comment",
    "kerf::gcode::limits::check_reach::",
    "kerf::gcode::state::State>::begin",
    "kerf::gcode::state::State>::carry_out",
    "kerf::gcode::state::State>::end_motion::",
    "kerf::gcode::state::State>::execute::",
    "kerf::gcode::state::State>::finish::",
    "kerf::gcode::state::State>::motion::",
    "kerf::gcode::state::State>::usual::",
    "kerf::gcode::steps::Steps>::next",
    "kerf::gcode::usual::",
    "kerf::motion::",
    "kerf::motion::limits::over",
    "kerf::motion::line::Builder>::line::",
    "kerf::motion::steps::Motor>::go",
    "kerf::protocol::line::Span>::of",
    "kerf::protocol::tinyg::block::put_brief::",
    "kerf::protocol::tinyg::format::Format>::",
    "kerf::protocol::tinyg::json::Cursor>::blanks",
    "kerf::protocol::tinyg::json::Cursor>::take",
    "kerf::protocol::tinyg::notice::Banner>::step::",
    "kerf::protocol::tinyg::notice::put_row::",
    "kerf::protocol::tinyg::report::Report>::step::",
    "kerf::protocol::tinyg::report::StatusReport>::",
    "kerf::protocol::tinyg::request::Request",
    "kerf::protocol::tinyg::request::Request>::open::",
    "kerf::protocol::tinyg::status::number",
    "kerf::protocol::tinyg::telling::Telling",
    "kerf::protocol::tinyg::token::Token>::",
    "kerf::protocol::tinyg::value::Source>::read::",
    "kerf::protocol::tinyg::variation::Variation>::",
    "kerf::protocol::tinyg::write::Writer",
    "kerf::spindle::Spindle>::set",
    "kerf::store::kept::",
    "kerf::store::log::",
    "kerf::tasks::common::snapshot",
    "kerf::tasks::exec::Waiting>::has_room",
    "kerf::tasks::exec::run::",
    "kerf::tasks::health::look_for_starvation",
    "kerf::tasks::lines::LinePool>::end_line",
    "kerf::tasks::lines::LinePool>::end_question",
    "kerf::tasks::lines::LinePool>::put",
    "kerf::tasks::lines::LinePool>::put_text",
    "kerf::tasks::lines::LinePool>::ready",
    "kerf::tasks::lines::LinePool>::remove",
    "kerf::tasks::lines::LinePool>::start_of",
    "kerf::tasks::lines::LinePool>::text",
    "kerf::tasks::links::Links>::may_feed",
    "kerf::tasks::overtake::Scan>::serve",
    "kerf::tasks::parser::",
    "kerf::tasks::planner::Planner>::announce",
    "kerf::tasks::planner::Planner>::build_chain",
    "kerf::tasks::planner::Planner>::carry_out_at_once",
    "kerf::tasks::planner::Planner>::close_chain",
    "kerf::tasks::planner::Planner>::is_due",
    "kerf::tasks::planner::Planner>::line",
    "kerf::tasks::planner::Planner>::replan",
    "kerf::tasks::planner::Planner>::turn",
    "kerf::tasks::planner::run::",
    "kerf::tasks::ports::Port>::promise",
    "kerf::tasks::reader::Intake",
    "kerf::tasks::reader::run::",
    "kerf::tasks::reporter::",
    "kerf::tasks::storage::Storage>::cold",
    "kerf::tasks::storage::differs",
    "kerf::tasks::storage::next",
    "kerf::tasks::storage::run::",
    "kerf::tasks::switches::mode",
    "kerf::tasks::tx::Tx",
    "kerf::tasks::tx::Tx>::has_room",
    "kerf::tasks::view::View",
    "kerf::tasks::view::View>::carries_out",
    "kerf::tasks::view::View>::modal",
    "kerf::tasks::view::View>::of",
    "kerf::tasks::view::View>::seen",
    "kerf::tasks::wake::Wake>::",
];

/// Of these, what seldom runs.
const COLD: &[&str] = &[
    "kerf::config::setting::Owner>::of_name",
    "kerf::config::setting::Setting>::find::",
    "kerf::gcode::usual::Words>::feed",
    "kerf::motion::block::Line>::capped",
    "kerf::motion::block::Line>::key",
    "kerf::motion::chain::Chain>::closed",
    "kerf::motion::constraint::needed",
    "kerf::motion::curve::Curve>::of",
    "kerf::motion::curve::acceleration",
    "kerf::motion::dynamics::",
    "kerf::motion::exec::Exec>::drop_all",
    "kerf::motion::exec::Exec>::dwell",
    "kerf::motion::exec::Exec>::take_up",
    "kerf::motion::float::cube_root",
    "kerf::motion::governor::Governor>::arrive::",
    "kerf::motion::governor::Governor>::bottom",
    "kerf::motion::governor::Governor>::bottom_out",
    "kerf::motion::governor::Governor>::brake_harder",
    "kerf::motion::governor::Governor>::creep",
    "kerf::motion::governor::Governor>::go_down_to::",
    "kerf::motion::governor::Governor>::lay",
    "kerf::motion::governor::Governor>::level_off",
    "kerf::motion::governor::Governor>::leveling",
    "kerf::motion::governor::Governor>::look_further::",
    "kerf::motion::governor::Governor>::reconsider::",
    "kerf::motion::governor::Governor>::recover::",
    "kerf::motion::governor::Governor>::slow_down::",
    "kerf::motion::governor::Governor>::slow_for_clear",
    "kerf::motion::governor::Governor>::try_bottom::",
    "kerf::motion::junction::mean_deviation",
    "kerf::motion::limits::",
    "kerf::motion::line::",
    "kerf::motion::pace::paces",
    "kerf::motion::path::Path>::look_along",
    "kerf::motion::path::exact_norm",
    "kerf::motion::prep::Prep>::begin_far",
    "kerf::motion::prep::Prep>::behind_turn",
    "kerf::motion::prep::Prep>::cut",
    "kerf::motion::prep::Prep>::left_of",
    "kerf::motion::prep::Prep>::lengthen",
    "kerf::motion::queue::BlockQueue>::install",
    "kerf::motion::queue::BlockQueue>::look_back",
    "kerf::motion::queue::BlockQueue>::needless",
    "kerf::motion::queue::BlockQueue>::replan",
    "kerf::motion::steps::Motor>::",
    "kerf::protocol::tinyg::token::Token>::find_row",
    "kerf::store::kept::load::",
    "kerf::store::log::Log>::append::",
    "kerf::tasks::parser::echo",
    "kerf::tasks::parser::has_left",
    "kerf::tasks::parser::job_line",
    "kerf::tasks::parser::ran",
    "kerf::tasks::reporter::tell_at_once",
];

/// Whether a function of this name is hot.
pub fn is_hot(name: &str) -> bool {
    let longest = |rows: &[&str]| {
        rows.iter().filter(|row| begins(name, row)).map(|row| row.len()).max().unwrap_or(0)
    };
    longest(HOT) > longest(COLD)
}

/// The rows that no function is named by.
pub fn stale<'a>(names: impl Iterator<Item = &'a str> + Clone) -> Vec<&'static str> {
    let stale = |row: &&&str| !names.clone().any(|name| begins(name, row));
    HOT.iter().chain(COLD).filter(stale).copied().collect()
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
        assert!(is_hot("<kerf::tasks::planner::Planner>::line"));
        for name in [
            "<kerf::tasks::planner::Planner>::line_of_arc",
            "<kerf::motion::exec::Exec>::drop_all",
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
