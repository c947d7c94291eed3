//! Every row of the bench keeps to its floor.

use std::sync::{LazyLock, Mutex, PoisonError};

use kerf::boards::{MEGA2560_GRBL, RAMPS14};
use kerf_sim::bench::{Bed, ROWS, row};

use crate::common::image;
use crate::common::share::share_of;

/// Rows that differ by the jerk limit and take long: a share of them runs.
const PAUSES: [&str; 4] = ["pauses-none", "pauses-500", "pauses-5000", "pauses-50000"];

/// The bed of the rows that measure all jobs of the corpus once.
static CORPUS: LazyLock<Mutex<Bed>> =
    LazyLock::new(|| Mutex::new(Bed::new(&image(&MEGA2560_GRBL), &MEGA2560_GRBL).unwrap()));

fn keeps_to_its_floor(name: &str) {
    if PAUSES.contains(&name) && !share_of(&PAUSES, 2).any(|due| *due == name) {
        return;
    }
    let row = row(name).unwrap();
    if name.starts_with("axes") {
        let bed = CORPUS.lock().unwrap_or_else(PoisonError::into_inner);
        return row.keep_to_floor(&bed).unwrap();
    }
    let bed = Bed::new(&image(&MEGA2560_GRBL), &MEGA2560_GRBL).unwrap();
    if name.starts_with("print") {
        // The bench looks for this image beside the other one.
        image(&RAMPS14);
    }
    row.keep_to_floor(&bed).unwrap();
}

rows! {
    one_motor = "rate-1";
    three_motors = "rate-3";
    four_motors = "rate-4";
    one_motor_under_a_jerk_limit = "rate-1-jerk";
    three_motors_under_a_jerk_limit = "rate-3-jerk";
    four_motors_under_a_jerk_limit = "rate-4-jerk";
    jitter_on_a_quiet_line = "jitter-quiet";
    jitter_on_a_busy_line = "jitter-busy";
    jitter_of_a_minor_motor = "jitter-minor";
    jitter_over_ends_of_blocks = "jitter-blocks";
    jitter_over_ends_of_slow_blocks = "jitter-slow";
    moves_of_a_tenth = "spiral-0.1";
    moves_of_a_tenth_in_grbls_dialect = "spiral-0.1-grbl";
    moves_of_a_fifth = "spiral-0.2";
    moves_of_a_half = "spiral-0.5";
    moves_of_a_tenth_on_a_fast_line = "spiral-0.1-fast";
    moves_of_a_fifth_on_a_fast_line = "spiral-0.2-fast";
    moves_of_a_half_on_a_fast_line = "spiral-0.5-fast";
    moves_of_a_tenth_with_short_answers = "spiral-0.1-terse";
    moves_of_a_tenth_under_a_jerk_limit_over_the_ideal = "spiral-0.1-smooth";
    moves_of_a_tenth_under_a_jerk_limit = "spiral-0.1-jerk";
    moves_of_a_fifth_under_a_jerk_limit = "spiral-0.2-jerk";
    moves_of_a_half_under_a_jerk_limit = "spiral-0.5-jerk";
    lines_in_a_second = "lines";
    lines_in_a_second_in_grbls_dialect = "lines-grbl";
    lines_in_a_second_under_a_jerk_limit = "lines-jerk";
    lines_in_a_second_on_a_curve = "lines-curve";
    cycles_of_a_line = "line-cycles";
    look_ahead = "ahead";
    velocity_from_slice_to_slice = "jumps";
    interrupts_off = "interrupts-off";
    cycles_of_a_segment = "segment";
    cycles_of_a_segment_under_a_jerk_limit = "segment-jerk";
    most_cycles_of_a_segment_under_a_jerk_limit = "segment-jerk-worst";
    cycles_of_replanning = "replan";
    beyond_the_limit = "beyond";
    pauses_without_a_jerk_limit = "pauses-none";
    pauses_under_a_low_jerk_limit = "pauses-500";
    pauses_under_a_usual_jerk_limit = "pauses-5000";
    pauses_under_a_high_jerk_limit = "pauses-50000";
    a_lone_move_of_a_tenth = "lone-0.1";
    a_lone_move_of_one = "lone-1";
    a_lone_move_of_ten = "lone-10";
    a_lone_move_of_a_hundred = "lone-100";
    a_hold_begins = "hold-begins";
    a_hold_stops = "hold-stops";
    acceleration_on_arcs = "arcs-ac";
    acceleration_of_axes = "axes-ac";
    jerk_of_axes = "axes-jerk";
    distance_from_the_path = "axes-off";
    time_of_the_corpus = "axes-time";
    a_printers_moves = "print-0.2";
    a_printers_moves_with_pressure_advance = "print-0.2-advance";
    a_printers_moves_with_checksums = "print-0.2-numbered";
}
