//! The settings of heaters, for images that can print.

use super::group;

group! {
    /// The group `he1`, the hot end.
    hot_end: i32, PLAIN => {
        K "k": sensor(0), 1,
            words(text!("hot end sensor"), SENSORS),
            "Sensor, see printing.md; 6, a MAX6675, on boards with a pin for it. With 0 there is no such heater.";
        P "p": up_to(cold(2), 600_000), 20_000,
            words(text!("hot end p"), NONE),
            "Power, of 255, for a degree that it is too cold. With 0 it is switched on and off.";
        I "i": up_to(cold(2), 600_000), 800,
            words(text!("hot end i"), NONE),
            "Power a second for a degree that it is too cold.";
        D "d": up_to(cold(2), 600_000), 80_000,
            words(text!("hot end d"), NONE),
            "Power for a degree a second that it gets colder.";
        F "f": whole(cold(0), 255), 0,
            words(text!("hot end fan power"), NONE),
            "Power that the fan at full takes away: it is given beside the rest.";
        HY "hy": up_to(cold(1), 20_000), 2_000,
            words(text!("hot end hysteresis"), DEGREES),
            "With `he1p` 0: degrees between on and off.";
        MX "mx": whole(cold(0), 330), 275,
            words(text!("hot end max"), DEGREES),
            "How hot it may be made, degrees; 15 more are a fault (52).";
        MN "mn": whole(cold(0), 330), 170,
            words(text!("hot end min to extrude"), DEGREES),
            "How hot it must be for filament to be moved, degrees.";
        PA "pa": seconds(20_000), 0,
            words(text!("pressure advance"), SECONDS),
            "Pressure advance K from the start on, s: how far the extruder is ahead of its line, for each mm/s of filament. M900 K changes it until the next start.";
    }
}

group! {
    /// The group `he3`, the bed.
    bed: i32, PLAIN => {
        K "k": sensor(1), 1,
            words(text!("bed sensor"), SENSORS),
            "Sensor, as `he1k`.";
        P "p": up_to(cold(2), 600_000), 0,
            words(text!("bed p"), NONE),
            "Power, of 255, for a degree that it is too cold. With 0 it is switched on and off.";
        I "i": up_to(cold(2), 600_000), 0,
            words(text!("bed i"), NONE),
            "Power a second for a degree that it is too cold.";
        D "d": up_to(cold(2), 600_000), 0,
            words(text!("bed d"), NONE),
            "Power for a degree a second that it gets colder.";
        F "f": whole(cold(0), 255), 0,
            words(text!("bed fan power"), NONE),
            "Power that the fan at full takes away.";
        HY "hy": up_to(cold(1), 20_000), 1_000,
            words(text!("bed hysteresis"), DEGREES),
            "With `he3p` 0: degrees between on and off.";
        MX "mx": whole(cold(0), 150), 120,
            words(text!("bed max"), DEGREES),
            "How hot it may be made, degrees; 15 more are a fault (52).";
    }
}
