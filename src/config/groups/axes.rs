//! The settings of axes.

use super::group;

group! {
    /// The groups `x` to `c`. B and C, which never home, lack the rows with `HOMING`.
    axis: [i32; AXES], DEFAULT.axis => {
        AM "am": int(0, 3).with(MODE | IDLE), [1, 1, 1, crate::capability::Capability::Printer.is_built_in() as i32, 0, 0],
            bare(text!("axis mode")),
            "0 disabled, 1 standard, 2 inhibited: the position counts, the motors do not move, 3 radius: axis words are lengths, which `ra` converts to angles. A is on by default only where it may be an extruder, on boards with heaters.";
        VM "vm": fixed(3, 0, POSITIVE).with(UNIT), [800_000, 800_000, 800_000, 230_400_000, 3_600_000, 3_600_000],
            length(text!("velocity maximum"), SPEED),
            "Maximum velocity of rapid moves (G0). Kerf lowers a value that the motors cannot follow, and a message says so.";
        FR "fr": fixed(3, 0, POSITIVE).with(UNIT), [800_000, 800_000, 800_000, 230_400_000, 3_600_000, 3_600_000],
            length(text!("feedrate maximum"), SPEED),
            "Maximum velocity of feed moves (G1, G2, G3). Kerf lowers a value that the motors cannot follow, and a message says so.";
        TN "tn": fixed(4, 3, ANY).with(UNIT | CLAMP), [0, 0, 0, -1_0000, -1_0000, -1_0000],
            length(text!("travel minimum"), NONE),
            "Travel minimum: lower end of travel in machine coordinates, for soft limits (`sl`). It is also the position after homing to the lower switch. -214748.3647 means no limit.";
        TM "tm": fixed(4, 3, ANY).with(UNIT | CLAMP), [150_0000, 150_0000, 75_0000, -1_0000, -1_0000, -1_0000],
            length(text!("travel maximum"), NONE),
            "Travel maximum: upper end of travel in machine coordinates, for soft limits (`sl`). It is also the position after homing to the upper switch. The default 0 of Z puts machine zero at the top of Z. -214748.3647 means no limit. If `tn` and `tm` are equal, the axis has no limit at either end.";
        JM "jm": fixed(3, 0, POSITIVE).with(UNIT | JERK), [20_000, 20_000, 20_000, 5_760_000, 20_000, 20_000],
            length(text!("jerk maximum"), JERK_UNIT),
            "Maximum jerk. A value above 1000000 is divided by a million. A value of 6 times `ac` takes about 36 ms to reach `ac`. The axis for which that takes longest decides for all, so set all to the same ratio; it counts as 44 ms at most (60 on an RP2040). Where an axis reverses from `ac` to -`ac` at once, its jerk is twice the maximum. A value of 216 times `ac` or more reaches `ac` within 1 ms. Such a value has no effect: `ac` alone limits the ramps, and a message says so.";
        JH "jh": fixed(3, 0, POSITIVE).with(UNIT | JERK | HOMING), [40_000, 40_000, 40_000, 11_520_000, 0, 0],
            length(text!("jerk homing"), JERK_UNIT),
            "Maximum jerk while homing and probing. A value above 1000000 is divided by a million. `ac` applies while homing and probing, too.";
        JD "jd": fixed(6, 4, 0).with(UNIT), [50_000; 6],
            length(text!("junction deviation"), text!(" (larger is faster)")),
            "Junction deviation. A larger value makes corners faster. The path itself is not rounded at corners.";
        RA "ra": fixed(6, 3, POSITIVE).with(UNIT | RADIUS), [0, 0, 0, 198_944, 1_000_000, 1_000_000],
            length(text!("radius value"), NONE).with_decimals(4),
            "Radius that converts a length to an angle with `am` 3.";
        SN "sn": int(0, 3).with(HOMING), [1, 1, 0, 1, 0, 0],
            words(text!("switch min"), SWITCHES),
            "Switch at the lower end of travel. A limit switch that is hit stops all motion, spindle and coolant (exception 204) until `{clear:n}`. An axis homes only if exactly one of `sn` and `sx` is 1 or 3.";
        SX "sx": int(0, 3).with(HOMING), [0, 0, 1, 0, 0, 0],
            words(text!("switch max"), SWITCHES),
            "Switch at the upper end of travel; see `sn`.";
        SV "sv": fixed(3, 0, 0).with(UNIT | HOMING), [500_000, 500_000, 400_000, 600_000, 0, 0],
            length(text!("search velocity"), SPEED),
            "Homing search velocity, towards the switch. If `vm` is lower, `vm` applies instead, and a message says so. `fr` does not limit it. The axis must be able to stop between the switch and the end stop: `sv` 800 with `ac` 200 takes 0.5 mm or more. 0: the axis cannot be homed (242).";
        LV "lv": fixed(3, 0, 0).with(UNIT | HOMING), [100_000, 100_000, 100_000, 100_000, 0, 0],
            length(text!("latch velocity"), SPEED),
            "Homing latch velocity, away from the switch, at which the switch position is measured. 0: the axis cannot be homed (243).";
        LB "lb": fixed(4, 3, 0).with(UNIT | HOMING), [5_0000, 5_0000, 5_0000, 5_0000, 0, 0],
            length(text!("latch backoff"), NONE),
            "Latch backoff: maximum distance off the homing switch, within which the switch must open. 0: the position where the switch closes is used instead. The search covers the travel plus `lb`.";
        ZB "zb": fixed(4, 3, 0).with(UNIT | HOMING), [1_0000, 1_0000, 1_0000, 2_0000, 0, 0],
            length(text!("zero backoff"), NONE),
            "Zero backoff: distance from the position where the homing switch opens to the end of travel, where homing ends.";
        AC "ac": fixed(1, 1, 0).with(UNIT), [0; 6],
            length(text!("acceleration maximum"), text!("/s^2 (0 is none)")),
            "Maximum acceleration. 0: no limit, only the jerk limits the ramps. If `jm` reaches `ac` within 1 ms, `jm` has no effect, and a message says so.";
        BL "bl": if crate::capability::Capability::Backlash.is_built_in() { up_to(fixed(4, 3, 0), 2_0000).with(UNIT | HOMING | IDLE) } else { constant(3).with(HOMING) }, [0; 6],
            length(text!("backlash"), NONE),
            "Backlash: how far the motor turns before the axis follows, when it reverses; at most 4,095 steps. Kerf adds this distance at each reversal, without a stop. The axis then has 3/4 of `ac`, `jm` and `jh`, and 15/16 of `vm` and `fr`, for its path. Under G61 only reversals at which the machine stops are compensated. On a CoreXY machine X is for the motor that drives X + Y, and Y for the other one.";
    }
}
