//! The settings of motor drivers that are configured by UART, for boards with such drivers.

use super::group;

group! {
    /// The group `dr`. It has a row for each motor, because a setting that is in EEPROM only has one value per row.
    driver: i32, PLAIN => {
        R1 "r1": current(), 580,
            words(text!("run current m1"), AMPERES),
            "Current of motor 1 in motion, RMS.";
        R2 "r2": current(), 580,
            words(text!("run current m2"), AMPERES),
            "Current of motor 2 in motion.";
        R3 "r3": current(), 580,
            words(text!("run current m3"), AMPERES),
            "Current of motor 3 in motion.";
        R4 "r4": current(), 580,
            words(text!("run current m4"), AMPERES),
            "Current of motor 4 in motion.";
        H1 "h1": current(), 310,
            words(text!("hold current m1"), AMPERES),
            "Current of motor 1 at standstill, RMS.";
        H2 "h2": current(), 310,
            words(text!("hold current m2"), AMPERES),
            "Current of motor 2 at standstill.";
        H3 "h3": current(), 310,
            words(text!("hold current m3"), AMPERES),
            "Current of motor 3 at standstill.";
        H4 "h4": current(), 310,
            words(text!("hold current m4"), AMPERES),
            "Current of motor 4 at standstill.";
        C1 "c1": choice().with(IDLE), 1,
            words(text!("stealthchop m1"), OFF_ON),
            "Chopper of motor 1: 1 stealthChop, which is quiet; 0 spreadCycle.";
        C2 "c2": choice().with(IDLE), 1,
            words(text!("stealthchop m2"), OFF_ON),
            "Chopper of motor 2.";
        C3 "c3": choice().with(IDLE), 1,
            words(text!("stealthchop m3"), OFF_ON),
            "Chopper of motor 3.";
        C4 "c4": choice().with(IDLE), 1,
            words(text!("stealthchop m4"), OFF_ON),
            "Chopper of motor 4.";
        S1 "s1": whole(cold(0), 255).with(IDLE), 0,
            words(text!("stall threshold m1"), NONE),
            "Sensitivity of motor 1 to a stall, by which X [homes without a switch](rp2040.md#homing-by-a-stall); 0 is off.";
        S2 "s2": whole(cold(0), 255).with(IDLE), 0,
            words(text!("stall threshold m2"), NONE),
            "Sensitivity of motor 2, by which Y homes.";
        S3 "s3": whole(cold(0), 255).with(IDLE), 0,
            words(text!("stall threshold m3"), NONE),
            "Sensitivity of motor 3, by which Z homes.";
    }
}
