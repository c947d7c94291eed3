//! The settings of motors.

use super::group;
use crate::boards::MOTORS;

/// Combines the values of the first four motors with those of a fifth and sixth, if the board has them.
const fn motors(first: [i32; 4], more: [i32; 2]) -> [i32; MOTORS] {
    let mut values = [0; MOTORS];
    let mut m = 0;
    while m < MOTORS {
        values[m] = if m < first.len() { first[m] } else { more[m - first.len()] };
        m += 1;
    }
    values
}

group! {
    /// The groups `1` to `4`, and `5` and `6` on a board with more motors.
    motor: [i32; MOTORS], CAREFUL.motor => {
        MA "ma": int(0, 255), super::motors([0, 1, 2, 3], [4, 5]),
            words(text!("map to axis"), text!(" [0=X,1=Y,2=Z...]")),
            "Axis that it moves: 0 X, 1 Y, 2 Z, 3 A, 4 B, 5 C; above 7 none. Several may move one axis. 6 is X + Y and 7 is X - Y, for the two motors of a CoreXY machine, in images that have `corexy`.";
        SA "sa": fixed(4, 3, POSITIVE), [1_8000; MOTORS],
            words(text!("step angle"), text!(" deg")),
            "Angle of a full step.";
        TR "tr": fixed(6, 4, POSITIVE).with(UNIT), super::motors([1_250_000, 1_250_000, 1_250_000, 360_000_000], [360_000_000; 2]),
            length(text!("travel per revolution"), NONE),
            "Travel of the axis in a turn. More than 10,000 steps in a millimetre or degree leave less room for positions: see [how far numbers go](protocol.md#how-far-numbers-go).";
        MI "mi": int(1, 255), [8; MOTORS],
            words(text!("microsteps"), text!(" [1,2,4,8]")),
            "Microsteps of the driver. 1, 2, 4 and 8 are taken as they are. Others, such as 16, are taken with a warning, which is harmless.";
        PO "po": int(0, 1), [0; MOTORS],
            words(text!("polarity"), POLARITY),
            "Direction.";
        PM "pm": int(0, 3), [2; MOTORS],
            words(text!("power management"), text!(" [0=disabled,1=always on,2=in cycle,3=when moving]")),
            "When it is powered; see `mt`.";
        SP "sp": int(0, 1), [0; MOTORS],
            words(text!("step polarity"), POLARITY),
            "Whether the driver steps on a falling edge.";
    }
}

group! {
    /// The group `sq`.
    squaring: i32, PLAIN => {
        SW "sw": whole(cold(0), inputs::COUNT as i32), 0,
            bare(text!("squaring switch")),
            "Input of the second motor's own homing switch, as `in1`, `in2`..; 0 is none, and the axis is not squared. The second motor is the higher-numbered of the two with the same `ma`.";
        OF "of": shift(20_0000), 0,
            bare(text!("squaring offset")),
            "How much farther off its switch than the first motor it stands when the axis is square.";
    }
}
