//! The settings of the spindle, its PWM and the coolant.

use super::group;

group! {
    /// The group `p1`.
    pwm: i32, PLAIN => {
        FRQ "frq": cold(0), 1_000_000,
            words(text!("pwm frequency"), text!(" Hz")),
            "Frequency; 0.122 Hz is the lowest there is.";
        CSL "csl": cold(0), 0,
            words(text!("pwm cw speed lo"), TURNS),
            "Speed (RPM) that gets duty `cpl`; any lower S gets the same.";
        CSH "csh": cold(0), 24_000_000,
            words(text!("pwm cw speed hi"), TURNS),
            "Speed (RPM) that gets duty `cph`; any higher S gets the same.";
        CPL "cpl": up_to(cold(3), 1_000), 0,
            words(text!("pwm cw phase lo"), PHASE),
            "Share of the period at the lowest speed, clockwise.";
        CPH "cph": up_to(cold(3), 1_000), 1_000,
            words(text!("pwm cw phase hi"), PHASE),
            "Share of the period at the highest speed, clockwise.";
        WSL "wsl": cold(0), 0,
            words(text!("pwm ccw speed lo"), TURNS),
            "Lowest speed, counter-clockwise.";
        WSH "wsh": cold(0), 24_000_000,
            words(text!("pwm ccw speed hi"), TURNS),
            "Highest speed, counter-clockwise.";
        WPL "wpl": up_to(cold(3), 1_000), 0,
            words(text!("pwm ccw phase lo"), PHASE),
            "Share of the period at the lowest speed, counter-clockwise.";
        WPH "wph": up_to(cold(3), 1_000), 1_000,
            words(text!("pwm ccw phase hi"), PHASE),
            "Share of the period at the highest speed, counter-clockwise.";
        POF "pof": up_to(cold(3), 1_000), 0,
            words(text!("pwm phase off"), PHASE),
            "Share of the period while the spindle is off, or S is 0. Keep 0 unless the drive needs pulses at rest, as a hobby ESC does.";
    }
}

group! {
    /// The group `sp`.
    spindle: i32, PLAIN => {
        PH "ph": choice(), 0,
            words(text!("spindle pause on hold"), OFF_ON),
            "Whether the spindle stands still in a feedhold. It starts again before motion goes on, but not after `%`.";
        DE "de": up_to(cold(3), 60_000), 0,
            words(text!("spindle spinup delay"), text!(" seconds")),
            "Time that moves wait for when the spindle has been started, or turned round.";
        EP "ep": choice(), 1,
            words(text!("spindle enable polarity"), LEVEL),
            "Level of the enable pin that is on. Until the settings have been read after a reset it is not driven.";
        DP "dp": choice(), 0,
            words(text!("spindle direction polarity"), text!(" [0=CW is low,1=CW is high]")),
            "Level of the direction pin.";
        N "n": whole(cold(0), 400).with(IDLE), 0,
            words(text!("spindle pulses per turn"), text!(" [0=no encoder,1=index only]")),
            "Sync pulses of the encoder in a turn. With 1 the index alone is read, with 0 nothing. Its pins are no switches then (wiring.md).";
        B "b": whole(cold(0), 200_000).with(IDLE), 0,
            words(text!("spindle pulse bounce"), text!(" us")),
            "How long contacts of the encoder bounce: a pulse counts if its pin has been still for so long before.";
        R "r": shift(1_000_000).with(IDLE), 0,
            length(text!("spindle thread retract"), NONE),
            "How far X leaves the cut when a thread ends before its time: the spindle is lost, the error is above `spl`, or a feedhold comes. Below 0 towards lower X. G76 goes to the side of its drive line whatever the sign. X goes 32,767 steps at most. 0 has the axes stop in the cut, and a feedhold wait for the end of the pass.";
        L "l": up_to(cold(3), 100_000).with(UNIT | IDLE), 0,
            length(text!("spindle thread error limit"), NONE),
            "How far the axes of a thread may be from where the spindle says, once they have been there; beyond that is an alarm (46). 0 for no limit.";
        DI "di": choice().with(IDLE), 0,
            words(text!("spindle direction sensor"), OFF_ON),
            "Whether the encoder has a second sync sensor, which tells the direction. Of no use with `spn` 0 and 1, or on a board without a pin for it.";
    }
}

group! {
    /// The group `co`.
    coolant: i32, PLAIN => {
        PH "ph": choice(), 0,
            words(text!("coolant pause on hold"), OFF_ON),
            "Whether mist and flood pause in a feedhold. They go on with the motion, but not after `%`.";
    }
}
