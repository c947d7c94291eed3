//! Hot, warm and cold functions: how much of the code of each may be shared.
//!
//! A row is a prefix of names, up to the end of a word: a folder, a module, a type or a function. The longest row that
//! matches a function's name decides. A function that no row matches is cold.
//!
//! The rows are derived from a profile: `KERF_COUNTS=FOLDER cargo xtask bench` writes how often each instruction ran.
//! Outlining costs 25 cycles for each call of a function, plus 6 % of its own time. Tail merging costs 3 cycles. If
//! that is more than 3 millionths of the time of a job of the bench for each byte that it saves, the function is warm
//! or hot. In the code that prepares segments the limit is one millionth. The code that computes keys for the queue is
//! hot. `cargo xtask size` fails when a row no longer matches any function.

/// How much of a function may be shared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heat {
    /// All repeated code.
    Cold,
    /// Its tail only.
    Warm,
    /// Nothing.
    Hot,
}

/// Prefixes of the names of functions that stay unchanged.
const HOT: &[&str] = &[
    // Every interrupt, the executors and their tick.
    "__vector_",
    "kerf::hal::",
    "avr_embassy::",
    "embassy_executor::",
    "embassy_time::",
    "kerf::image::",
    "kerf::dda::",
    // Small functions that are called from everywhere.
    "memcpy",
    "memset",
    "core::",
    // Functions that run many times for each segment, block, line or report.
    "kerf::config::setting::Setting>::owner",
    "kerf::gcode::axes::value::",
    "kerf::gcode::command::Commands>::is_motion_alone",
    "kerf::gcode::decimal::Decimal>::",
    "kerf::gcode::number::",
    "kerf::gcode::state::State>::advance::",
    "kerf::gcode::state::State>::carry_out",
    "kerf::gcode::state::State>::fast_path::",
    "kerf::gcode::fast_path::",
    "kerf::motion::block::Line>::",
    "kerf::motion::chain::Minor>::pass",
    "kerf::motion::divide::",
    "kerf::motion::float::",
    "kerf::motion::prep::",
    "kerf::motion::queue::BlockQueue>::",
    "kerf::motion::sampler::",
    "kerf::motion::short::Log>::of",
    "kerf::motion::smooth::",
    "kerf::motion::steps::Motor>::go",
    "kerf::motion::tail::",
    "kerf::protocol::line::Span>::of",
    "kerf::protocol::tinyg::format::Format>::",
    "kerf::protocol::tinyg::status::number",
    "kerf::tasks::exec::",
    "kerf::tasks::health::look_for_starvation",
    "kerf::tasks::lines::LinePool>::end_line",
    "kerf::tasks::lines::LinePool>::end_question",
    "kerf::tasks::lines::LinePool>::put",
    "kerf::tasks::lines::LinePool>::put_text",
    "kerf::tasks::lines::LinePool>::ready",
    "kerf::tasks::lines::LinePool>::remove",
    "kerf::tasks::lines::LinePool>::start_of",
    "kerf::tasks::lines::LinePool>::text",
    "kerf::tasks::overtake::Scan>::serve",
    "kerf::tasks::parser::Parser>::line_of",
    "kerf::tasks::parser::run::",
    "kerf::tasks::planner::Planner>::carry_out_at_once",
    "kerf::tasks::planner::Planner>::close_chain",
    "kerf::tasks::planner::Planner>::is_due",
    "kerf::tasks::planner::Planner>::replan",
    "kerf::tasks::ports::Port>::promise",
    "kerf::tasks::reader::run::",
    "kerf::tasks::tx::Tx",
    "kerf::tasks::view::View>::of",
    "kerf::tasks::wake::Wake>::",
];

/// Functions that run as often as a segment, a block or a line. Their tails are shared, at a cost of two or three
/// cycles each.
pub const WARM: &[&str] = &[
    "kerf::gcode::lexer::comment",
    "kerf::gcode::interpreter::Interpreter",
    "kerf::motion::replan::",
    "kerf::protocol::tinyg::request::Request",
    "kerf::gcode::block::Block>::",
    "kerf::gcode::decimal::Decimal>::inch",
    "kerf::gcode::decimal::Decimal>::long_mm",
    "kerf::config::Settings>::get",
    "kerf::config::Settings>::put",
    "kerf::config::name::Name>::",
    "kerf::config::setting::",
    "kerf::gcode::limits::check_reach::",
    "kerf::gcode::state::State>::begin",
    "kerf::gcode::state::State>::end_motion::",
    "kerf::gcode::state::State>::execute::",
    "kerf::gcode::state::State>::finish::",
    "kerf::gcode::state::State>::motion::",
    "kerf::gcode::fast_path::Words>::integer",
    "kerf::motion::",
    "kerf::motion::limits::over",
    "kerf::motion::line::Builder>::line::",
    "kerf::protocol::tinyg::block::put_brief::",
    "kerf::protocol::tinyg::json::Cursor>::blanks",
    "kerf::protocol::tinyg::json::Cursor>::take",
    "kerf::protocol::tinyg::request::Request>::footer::",
    "kerf::protocol::tinyg::request::Request>::line_number::",
    "kerf::protocol::tinyg::request::Request>::open::",
    "kerf::protocol::tinyg::variation::Variation>::",
    "kerf::protocol::tinyg::write::Writer",
    "kerf::store::kept::Item>::",
    "kerf::store::kept::key",
    "kerf::store::log::",
    "kerf::tasks::common::snapshot",
    "kerf::tasks::links::Links>::may_feed",
    "kerf::tasks::parser::",
    "kerf::tasks::row::",
    "kerf::tasks::planner::Planner>::announce",
    "kerf::tasks::planner::Planner>::begin",
    "kerf::tasks::planner::Planner>::build_chain",
    "kerf::tasks::planner::Planner>::end_chain",
    "kerf::tasks::planner::Planner>::line",
    "kerf::tasks::planner::Planner>::make_up",
    "kerf::tasks::planner::Planner>::straight",
    "kerf::tasks::planner::Planner>::take_up_changes",
    "kerf::tasks::planner::run::",
    "kerf::tasks::reader::Intake",
    "kerf::tasks::reporter::State>::now",
    "kerf::tasks::reporter::run::",
    "kerf::tasks::storage::differs",
    "kerf::tasks::storage::run::",
    "kerf::tasks::switches::mode",
    "kerf::tasks::view::View",
    "kerf::tasks::view::View>::carries_out",
    "kerf::tasks::view::View>::seen",
];

/// Functions among the hot and warm ones that seldom run.
const COLD: &[&str] = &[
    "embassy_executor::raw::Executor>::spawn",
    "kerf::dda::Dda>::settle::",
    "kerf::dda::Drivers>::step_rate_max",
    "kerf::dda::step_replay::",
    "kerf::gcode::fast_path::Words>::feed",
    "kerf::motion::chain::Chain>::closed",
    "kerf::hal::imp::boot",
    "kerf::hal::imp::gpio::set_outputs",
    "kerf::hal::imp::panic::",
    "kerf::hal::imp::pwm::",
    "kerf::hal::imp::uart::stop_sender",
    "kerf::hal::imp::uart::take_asked",
    "kerf::hal::imp::watchdog::reset",
    "kerf::hal::serial::last_mark",
    "kerf::gcode::decimal::Decimal>::milliseconds",
    "kerf::motion::curve::Curve>::of",
    "kerf::motion::curve::acceleration",
    "kerf::motion::dynamics::",
    "kerf::motion::exec::Exec>::take_up",
    "kerf::motion::junction::arc",
    "kerf::motion::junction::mean",
    "kerf::motion::junction::mean_deviation",
    "kerf::motion::limits::",
    "kerf::motion::line::",
    "kerf::motion::pace::paces",
    "kerf::motion::path::Path>::limit_rate",
    "kerf::motion::path::Path>::unusual_velocity",
    "kerf::motion::path::normalize_far",
    "kerf::motion::path::stretch",
    "kerf::motion::prep::Prep>::begin_far",
    "kerf::motion::prep::Prep>::cut",
    "kerf::motion::prep::Prep>::lengthen",
    "kerf::motion::prep::Prep>::set_drivers",
    "kerf::motion::queue::BlockQueue>::install",
    "kerf::motion::queue::refined",
    "kerf::motion::steps::Motor>::",
    "kerf::store::log::Log>::append::",
    "kerf::tasks::exec::Runner>::held",
    "kerf::tasks::exec::Task>::new",
    "kerf::tasks::parser::answer::echo",
    "kerf::tasks::parser::answer::has_left",
    "kerf::tasks::parser::block::job_line",
    "kerf::tasks::parser::answer::ran",
];

/// Returns how hot a function of this name is.
pub fn heat(name: &str) -> Heat {
    let longest = |rows: &[&str]| {
        rows.iter().filter(|row| begins(name, row)).map(|row| row.len()).max().unwrap_or(0)
    };
    let (hot, warm, cold) = (longest(HOT), longest(WARM), longest(COLD));
    match () {
        () if hot > warm.max(cold) => Heat::Hot,
        () if warm > cold => Heat::Warm,
        () => Heat::Cold,
    }
}

/// Returns the rows that match no function, except rows of a dialect that the image lacks.
pub fn stale<'a>(names: impl Iterator<Item = &'a str> + Clone) -> Vec<&'static str> {
    let names_nothing = |row: &str| !names.clone().any(|name| begins(name, row));
    let stale = |row: &&&str| names_nothing(row) && !dialect(row).is_some_and(names_nothing);
    [HOT, WARM, COLD].into_iter().flatten().filter(stale).copied().collect()
}

/// Returns the module of `kerf::protocol` that a row is in, as a row: `kerf::protocol::tinyg::`.
fn dialect(row: &str) -> Option<&str> {
    let (name, _) = row.strip_prefix("kerf::protocol::")?.split_once("::")?;
    row.find(name).and_then(|at| row.get(..at + name.len() + 2))
}

/// Whether a name begins with a row. `<kerf::motion::exec::Exec>::run` begins with `kerf::motion::`; the poll of a
/// task begins with the task's name.
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
        for (name, heat) in [
            ("__vector_17", Heat::Hot),
            ("kerf::dda::Dda::settle", Heat::Hot),
            ("<&kerf::dda::x::X as Y>::z", Heat::Hot),
            ("<embassy_executor::raw::TaskStorage<kerf::dda::run::{closure#0}>>::poll", Heat::Hot),
            ("kerf::dda_of_arc", Heat::Cold),
            ("kerf::protocol::f::<kerf::dda::Dda>", Heat::Cold),
            ("main", Heat::Cold),
        ] {
            assert_eq!(super::heat(name), heat, "{name}");
        }
    }

    #[test]
    fn the_longest_row_says_how_hot_a_function_is() {
        for (rows, kind) in [(HOT, Heat::Hot), (WARM, Heat::Warm), (COLD, Heat::Cold)] {
            assert!(rows.iter().all(|row| heat(row) == kind));
        }
        let inside =
            |row: &&&str| WARM.iter().any(|warm| row.len() > warm.len() && row.starts_with(warm));
        assert!(COLD.iter().any(|row| inside(&row)), "a row inside of another");
    }

    #[test]
    fn a_row_that_names_nothing_is_stale() {
        let names = ["<kerf::motion::exec::Exec>::run"];
        let stale = stale(names.iter().copied());
        assert!(!stale.contains(&"kerf::motion::"));
        assert!(stale.contains(&"__vector_"));
    }

    #[test]
    fn rows_of_a_dialect_that_is_left_out_are_not_stale() {
        let row = "kerf::protocol::tinyg::status::number";
        let is_stale = |names: &[&'static str]| stale(names.iter().copied()).contains(&row);
        assert!(!is_stale(&["kerf::protocol::grbl::status::put"]));
        assert!(is_stale(&["kerf::protocol::tinyg::status::text"]));
        assert!(!is_stale(&[row]));
    }
}
