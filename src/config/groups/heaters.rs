//! The settings of heaters, for images that can print.

use super::group;

group! {
    /// The group `he1`, the hot end.
    hot_end: i32, PLAIN => {
        K "k": sensor(0), 1,
            words(text!("hot end sensor"), SENSORS),
            "Temperature sensor, see printing.md. 6 needs a board with a pin for a MAX6675. 0: there is no hot end heater.";
        P "p": up_to(cold(2), 600_000), 20_000,
            words(text!("hot end p"), NONE),
            "Proportional gain: power per degree below target. Power 255 is full power. The PID control acts within 12 degrees of the target. 0: on/off control with `he1hy`.";
        I "i": up_to(cold(2), 600_000), 800,
            words(text!("hot end i"), NONE),
            "Integral gain: power per second for each degree below target. Power 255 is full power.";
        D "d": up_to(cold(2), 600_000), 80_000,
            words(text!("hot end d"), NONE),
            "Derivative gain: power added per degree per second of cooling, or removed per degree per second of heating. Power 255 is full power.";
        F "f": whole(cold(0), 255), 0,
            words(text!("hot end fan power"), NONE),
            "Fan compensation: power added while the fan runs at full speed, and proportionally less at a lower speed. Power 255 is full power.";
        HY "hy": up_to(cold(1), 20_000), 2_000,
            words(text!("hot end hysteresis"), DEGREES),
            "Hysteresis with `he1p` 0. The heater switches on half of it below the target, and off half of it above the target.";
        MX "mx": whole(cold(0), 330), 275,
            words(text!("hot end max"), DEGREES),
            "Maximum target temperature. A measured temperature more than 15 degrees above it is fault 52.";
        MN "mn": whole(cold(0), 330), 170,
            words(text!("hot end min to extrude"), DEGREES),
            "Minimum hot end temperature at which filament may be moved.";
        PA "pa": seconds(20_000), 0,
            words(text!("pressure advance"), SECONDS),
            "Pressure advance K after start-up: lead of the extruder in mm per mm/s of filament speed. M900 K changes it until the next start.";
    }
}

group! {
    /// The group `he3`, the bed.
    bed: i32, PLAIN => {
        K "k": sensor(1), 1,
            words(text!("bed sensor"), SENSORS),
            "Temperature sensor, see printing.md. 6 needs a board with a pin for a MAX6675. 0: there is no bed heater.";
        P "p": up_to(cold(2), 600_000), 0,
            words(text!("bed p"), NONE),
            "Proportional gain: power per degree below target. Power 255 is full power. The PID control acts within 12 degrees of the target. 0: on/off control with `he3hy`.";
        I "i": up_to(cold(2), 600_000), 0,
            words(text!("bed i"), NONE),
            "Integral gain: power per second for each degree below target. Power 255 is full power.";
        D "d": up_to(cold(2), 600_000), 0,
            words(text!("bed d"), NONE),
            "Derivative gain: power added per degree per second of cooling, or removed per degree per second of heating. Power 255 is full power.";
        F "f": whole(cold(0), 255), 0,
            words(text!("bed fan power"), NONE),
            "Fan compensation: power added while the fan runs at full speed, and proportionally less at a lower speed. Power 255 is full power.";
        HY "hy": up_to(cold(1), 20_000), 1_000,
            words(text!("bed hysteresis"), DEGREES),
            "Hysteresis with `he3p` 0. The heater switches on half of it below the target, and off half of it above the target.";
        MX "mx": whole(cold(0), 150), 120,
            words(text!("bed max"), DEGREES),
            "Maximum target temperature. A measured temperature more than 15 degrees above it is fault 52.";
    }
}
