//! Every row of the bench of `pico` keeps to its floor. The tests run like those of `pico.rs`.

use std::sync::{LazyLock, Mutex, PoisonError};

use kerf::boards::{PICO, PICO6};
use kerf_sim::bench::emulated::{PicoBed, ROWS, named};

use crate::common::image;
use crate::common::share::share_of;

/// Rows that differ by the jerk limit and take long: a share of them runs.
const PAUSES: [&str; 2] = ["pauses-none", "pauses-5000"];

/// The bed of the rows that measure all jobs of the corpus once.
static CORPUS: LazyLock<Mutex<PicoBed>> = LazyLock::new(|| Mutex::new(PicoBed::new(&image(&PICO))));

/// The bed of the rows of ringing.
static RINGING: LazyLock<Mutex<PicoBed>> =
    LazyLock::new(|| Mutex::new(PicoBed::new(&image(&PICO))));

fn keeps_to_its_floor(name: &str) {
    if PAUSES.contains(&name) && !share_of(&PAUSES, 2).any(|due| *due == name) {
        return;
    }
    let row = named(name).unwrap();
    if name.starts_with("ring") {
        let bed = RINGING.lock().unwrap_or_else(PoisonError::into_inner);
        return row.keep_to_floor(&bed).unwrap();
    }
    if name.starts_with("axes") || name.starts_with("segment") {
        let bed = CORPUS.lock().unwrap_or_else(PoisonError::into_inner);
        return row.keep_to_floor(&bed).unwrap();
    }
    // The bench looks for this image beside the other one.
    image(&PICO6);
    row.keep_to_floor(&PicoBed::new(&image(&PICO))).unwrap();
}

rows! {
    #[ignore = "needs the emulator, which `cargo xtask test` installs"]
    one_motor = "rate-1";
    four_motors = "rate-4";
    six_motors = "rate-6";
    jitter_of_the_leading_motor = "jitter";
    jitter_of_another_motor = "jitter-minor";
    lines_in_a_second = "lines";
    lines_of_two_axes = "lines-xy";
    lines_of_three_axes_and_a_speed = "lines-xyzf";
    moves_of_a_tenth = "spiral-0.1";
    moves_of_a_tenth_under_a_jerk_limit = "spiral-0.1-jerk";
    share_of_exec = "exec";
    a_sample_under_a_jerk_limit = "segment-jerk";
    the_longest_run_of_exec = "segment-jerk-worst";
    acceleration_of_axes = "axes-ac";
    jerk_of_axes = "axes-jerk";
    distance_from_the_path = "axes-off";
    time_of_the_corpus = "axes-time";
    ringing_behind_a_mean = "ring-mean";
    ringing_near_the_resonance_behind_a_mean = "ring-mean-near";
    ringing_behind_three_impulses = "ring-ei";
    ringing_near_the_resonance_behind_three_impulses = "ring-ei-near";
    pauses_without_a_jerk_limit = "pauses-none";
    pauses_under_a_jerk_limit = "pauses-5000";
}
