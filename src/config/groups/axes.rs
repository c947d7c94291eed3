//! The settings of axes.

use super::group;

group! {
    /// The groups `x` to `c`. B and C, which never home, lack the rows with `HOMING`.
    axis: [i32; AXES], CAREFUL.axis => {
        AM "am": int(0, 3).with(MODE | IDLE), [1, 1, 1, 3, 0, 0],
            bare(text!("axis mode")),
            "0 disabled, 1 standard, 2 inhibited: counts and does not move, 3 radius: words are lengths along `ra`.";
        VM "vm": fixed(3, 0, POSITIVE).with(UNIT), [800_000, 800_000, 800_000, 230_400_000, 3_600_000, 3_600_000],
            length(text!("velocity maximum"), SPEED),
            "Speed of traverses at most. Lowered, with a message, if the motors cannot follow.";
        FR "fr": fixed(3, 0, POSITIVE).with(UNIT), [800_000, 800_000, 800_000, 230_400_000, 3_600_000, 3_600_000],
            length(text!("feedrate maximum"), SPEED),
            "Speed of feeds at most. Lowered likewise.";
        TN "tn": fixed(4, 3, ANY).with(UNIT | CLAMP), [0, 0, 0, -1_0000, -1_0000, -1_0000],
            length(text!("travel minimum"), NONE),
            "Lower end of travel, for `sl`, in machine coordinates; the position after homing at a lower switch. -214748.3647 means no limit.";
        TM "tm": fixed(4, 3, ANY).with(UNIT | CLAMP), [150_0000, 150_0000, 75_0000, -1_0000, -1_0000, -1_0000],
            length(text!("travel maximum"), NONE),
            "Upper end of travel, likewise; the position after homing at an upper switch. With 0 machine zero is there: the default of Z, whose zero is its top. -214748.3647 means no limit; `tn` = `tm`: no limits at all.";
        JM "jm": fixed(3, 0, POSITIVE).with(UNIT | JERK), [20_000, 20_000, 20_000, 5_760_000, 20_000, 20_000],
            length(text!("jerk maximum"), JERK_UNIT),
            "Jerk at most. A value above 1000000 is divided by a million. A jerk that reaches `ac` within 1 ms has no effect: ramps are those of `ac` alone, and a message says so. That is `jm` of 216 times `ac` and more. About 6 times `ac` takes 36 ms.";
        JH "jh": fixed(3, 0, POSITIVE).with(UNIT | JERK | HOMING), [40_000, 40_000, 40_000, 11_520_000, 0, 0],
            length(text!("jerk homing"), JERK_UNIT),
            "Jerk while homing and probing, likewise; `ac` holds there too.";
        JD "jd": fixed(6, 4, 0).with(UNIT), [50_000; 6],
            length(text!("junction deviation"), text!(" (larger is faster)")),
            "Junction deviation: larger means faster corners. The path itself is never cut.";
        RA "ra": fixed(6, 3, POSITIVE).with(UNIT | RADIUS), [0, 0, 0, 198_944, 1_000_000, 1_000_000],
            length(text!("radius value"), NONE).with_decimals(4),
            "Radius that turns a length into an angle with `am` 3.";
        SN "sn": int(0, 3).with(HOMING), [1, 1, 0, 1, 0, 0],
            words(text!("switch min"), SWITCHES),
            "Switch at the lower end. A limit that is hit stops everything (exception 204) until `{clear:n}`. One switch of an axis may be that of homing.";
        SX "sx": int(0, 3).with(HOMING), [0, 0, 1, 0, 0, 0],
            words(text!("switch max"), SWITCHES),
            "Switch at the upper end, likewise.";
        SV "sv": fixed(3, 0, 0).with(UNIT | HOMING), [500_000, 500_000, 400_000, 600_000, 0, 0],
            length(text!("search velocity"), SPEED),
            "Speed towards a homing switch, at most `vm`: a message says so. `fr` does not limit it. The axis must be able to stop between the switch and its hard end: `sv` 800 with `ac` 200 takes 0.5 mm and more. 0: the axis cannot be homed (242).";
        LV "lv": fixed(3, 0, 0).with(UNIT | HOMING), [100_000, 100_000, 100_000, 100_000, 0, 0],
            length(text!("latch velocity"), SPEED),
            "Speed off a homing switch, when its place is taken; 0: the axis cannot be homed (243).";
        LB "lb": fixed(4, 3, 0).with(UNIT | HOMING), [5_0000, 5_0000, 5_0000, 5_0000, 0, 0],
            length(text!("latch backoff"), NONE),
            "Largest back-off from the homing switch; it must open within it. 0: the closing edge is used.";
        ZB "zb": fixed(4, 3, 0).with(UNIT | HOMING), [1_0000, 1_0000, 1_0000, 2_0000, 0, 0],
            length(text!("zero backoff"), NONE),
            "Distance from where a homing switch opens to the end of travel.";
        AC "ac": fixed(1, 1, 0).with(UNIT), [0; 6],
            length(text!("acceleration maximum"), text!("/s^2 (0 is none)")),
            "Acceleration at most; 0 is none, and the jerk alone limits. `jm` says how soon it is reached; within 1 ms `jm` has no effect, and a message says so.";
    }
}
