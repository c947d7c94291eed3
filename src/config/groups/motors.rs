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
    motor: [i32; MOTORS], DEFAULT.motor => {
        MA "ma": int(0, 255), super::motors([0, 1, 2, 3], [4, 5]),
            words(text!("map to axis"), text!(" [0=X,1=Y,2=Z...]")),
            "Axis that the motor moves: 0 X, 1 Y, 2 Z, 3 A, 4 B, 5 C. A value above 7 means no axis. Several motors may move one axis. In images with `corexy`, 6 is X + Y and 7 is X - Y, for the two motors of a CoreXY machine.";
        SA "sa": fixed(4, 3, POSITIVE), [1_8000; MOTORS],
            words(text!("step angle"), text!(" deg")),
            "Step angle: rotation of the motor in one full step.";
        TR "tr": fixed(6, 4, POSITIVE).with(UNIT), super::motors([1_250_000, 1_250_000, 1_250_000, 360_000_000], [360_000_000; 2]),
            length(text!("travel per revolution"), NONE),
            "Travel of the axis in one revolution of the motor. More than 10,000 steps per millimetre or degree reduce the range of positions: see [how far numbers go](protocol.md#how-far-numbers-go).";
        MI "mi": int(1, 255), [8; MOTORS],
            words(text!("microsteps"), text!(" [1,2,4,8]")),
            "Microsteps per full step of the driver. Values other than 1, 2, 4 and 8, such as 16, are accepted with a warning, which is harmless. Where a UART configures the driver, only 1, 2, 4, 8 and so on up to 128 are accepted.";
        PO "po": int(0, 1), [0; MOTORS],
            words(text!("polarity"), POLARITY),
            "Motor polarity: the direction of rotation.";
        PM "pm": int(0, 3), [2; MOTORS],
            words(text!("power management"), text!(" [0=disabled,1=always on,2=in cycle,3=when moving]")),
            "Power management. Modes 2 (any motor moves) and 3 (this motor moves) keep the power on for `mt` after the last such move.";
        SP "sp": int(0, 1), [0; MOTORS],
            words(text!("step polarity"), POLARITY),
            "Step polarity. 1: the driver steps on the falling edge.";
    }
}

group! {
    /// The group `sq`.
    squaring: i32, PLAIN => {
        SW "sw": whole(cold(0), inputs::COUNT as i32), 0,
            bare(text!("squaring switch")),
            "Input of the homing switch of the axis's second motor: 1 is `in1`, 2 is `in2`, and so on. 0: no such switch, and no axis is squared. The second motor is the highest-numbered motor that has the `ma` of a lower-numbered one.";
        OF "of": shift(20_0000), 0,
            bare(text!("squaring offset")),
            "Squaring offset in mm: how much farther from its switch the second motor stands than the first motor from its own, when the axis is square.";
    }
}
