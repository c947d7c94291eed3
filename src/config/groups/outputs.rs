//! The settings of the spindle, its PWM and the coolant.

use super::group;

group! {
    /// The group `p1`.
    pwm: i32, PLAIN => {
        FRQ "frq": cold(0), 1_000_000,
            words(text!("pwm frequency"), HZ),
            "PWM frequency. A lower value than the hardware can make gives its lowest frequency, 0.12 Hz on an ATmega2560 and 3.8 Hz on an RP2040.";
        CSL "csl": cold(0), 0,
            words(text!("pwm cw speed lo"), TURNS),
            "Clockwise: spindle speed at which the PWM duty cycle is `cpl`. Any lower S above 0 gives that duty cycle, too.";
        CSH "csh": cold(0), 24_000_000,
            words(text!("pwm cw speed hi"), TURNS),
            "Clockwise: spindle speed at which the PWM duty cycle is `cph`. Any higher S gives that duty cycle, too.";
        CPL "cpl": up_to(cold(3), 1_000), 0,
            words(text!("pwm cw phase lo"), PHASE),
            "Clockwise: PWM duty cycle at the speed `csl`.";
        CPH "cph": up_to(cold(3), 1_000), 1_000,
            words(text!("pwm cw phase hi"), PHASE),
            "Clockwise: PWM duty cycle at the speed `csh`.";
        WSL "wsl": cold(0), 0,
            words(text!("pwm ccw speed lo"), TURNS),
            "Counter-clockwise: spindle speed at which the PWM duty cycle is `wpl`. Any lower S above 0 gives that duty cycle, too.";
        WSH "wsh": cold(0), 24_000_000,
            words(text!("pwm ccw speed hi"), TURNS),
            "Counter-clockwise: spindle speed at which the PWM duty cycle is `wph`. Any higher S gives that duty cycle, too.";
        WPL "wpl": up_to(cold(3), 1_000), 0,
            words(text!("pwm ccw phase lo"), PHASE),
            "Counter-clockwise: PWM duty cycle at the speed `wsl`.";
        WPH "wph": up_to(cold(3), 1_000), 1_000,
            words(text!("pwm ccw phase hi"), PHASE),
            "Counter-clockwise: PWM duty cycle at the speed `wsh`.";
        POF "pof": up_to(cold(3), 1_000), 0,
            words(text!("pwm phase off"), PHASE),
            "PWM duty cycle while the spindle is off or S is 0. Keep 0 unless the drive needs pulses at rest, as a hobby ESC does.";
    }
}

group! {
    /// The group `sp`.
    spindle: i32, PLAIN => {
        PH "ph": choice(), 0,
            words(text!("spindle pause on hold"), OFF_ON),
            "1: a feedhold stops the spindle. The spindle restarts before motion resumes, but not after a queue flush (`%`).";
        DE "de": up_to(cold(3), 60_000), 0,
            words(text!("spindle spinup delay"), text!(" seconds")),
            "Spin-up delay: moves wait for this time after the spindle has started or reversed.";
        EP "ep": choice(), 1,
            words(text!("spindle enable polarity"), LEVEL),
            "Polarity of the spindle enable output. After a reset the pin is not driven until the settings have been read.";
        DP "dp": choice(), 0,
            words(text!("spindle direction polarity"), text!(" [0=CW is low,1=CW is high]")),
            "Polarity of the spindle direction output.";
        N "n": whole(cold(0), 400).with(IDLE), 0,
            words(text!("spindle pulses per turn"), text!(" [0=no encoder,1=index only]")),
            "Sync pulses of the spindle encoder per revolution. 1: only the index pulse is used. Pins of the encoder are not available as switches (wiring.md).";
        B "b": whole(cold(0), 200_000).with(IDLE), 0,
            words(text!("spindle pulse bounce"), text!(" us")),
            "Debounce time of the spindle encoder: a pulse counts only if its pin has been stable for this long before the pulse.";
        R "r": shift(1_000_000).with(IDLE), 0,
            length(text!("spindle thread retract"), NONE),
            "Retract distance of X if a thread is aborted: the spindle is lost, the error is above `spl`, or a feedhold comes. A negative value retracts towards lower X. G76 always retracts towards its drive line, whatever the sign. X retracts 32,767 steps at most. 0: the axes stop in the cut, and a feedhold waits for the end of the pass.";
        L "l": up_to(cold(3), 100_000).with(UNIT | IDLE), 200,
            length(text!("spindle thread error limit"), NONE),
            "Maximum distance in a thread between the axes and the position that the spindle demands. It counts once the axes have been within it. A larger distance is alarm 46. It also ends a thread whose pulses disagree by more. 0: no limit.";
        DI "di": choice().with(IDLE), 0,
            words(text!("spindle direction sensor"), OFF_ON),
            "Direction sensing. 1: the encoder has a second sync sensor, which gives the direction. It has no effect with `spn` 0 or 1, or on a board without a pin for it.";
    }
}

group! {
    /// The group `co`.
    coolant: i32, PLAIN => {
        PH "ph": choice(), 0,
            words(text!("coolant pause on hold"), OFF_ON),
            "1: a feedhold switches mist and flood off. They come on again when motion resumes, but not after a queue flush (`%`).";
    }
}
