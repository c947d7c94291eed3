//! The settings of motor drivers that are configured by UART, for boards with such drivers.

use super::group;

group! {
    /// The group `dr`. It has a row for each motor, because a setting that is in EEPROM only has one value per row.
    driver: i32, PLAIN => {
        R1 "r1": current(), 580,
            words(text!("run current m1"), AMPERES),
            "Run current of motor 1 (RMS). The driver uses the nearest of 32 levels.";
        R2 "r2": current(), 580,
            words(text!("run current m2"), AMPERES),
            "Run current of motor 2 (RMS). The driver uses the nearest of 32 levels.";
        R3 "r3": current(), 580,
            words(text!("run current m3"), AMPERES),
            "Run current of motor 3 (RMS). The driver uses the nearest of 32 levels.";
        R4 "r4": current(), 580,
            words(text!("run current m4"), AMPERES),
            "Run current of motor 4 (RMS). The driver uses the nearest of 32 levels.";
        H1 "h1": current(), 310,
            words(text!("hold current m1"), AMPERES),
            "Hold current of motor 1 at standstill (RMS). The driver uses the nearest of 32 levels.";
        H2 "h2": current(), 310,
            words(text!("hold current m2"), AMPERES),
            "Hold current of motor 2 at standstill (RMS). The driver uses the nearest of 32 levels.";
        H3 "h3": current(), 310,
            words(text!("hold current m3"), AMPERES),
            "Hold current of motor 3 at standstill (RMS). The driver uses the nearest of 32 levels.";
        H4 "h4": current(), 310,
            words(text!("hold current m4"), AMPERES),
            "Hold current of motor 4 at standstill (RMS). The driver uses the nearest of 32 levels.";
        C1 "c1": choice().with(IDLE), 1,
            words(text!("stealthchop m1"), OFF_ON),
            "Chopper mode of motor 1: on is stealthChop, which is quiet; off is spreadCycle.";
        C2 "c2": choice().with(IDLE), 1,
            words(text!("stealthchop m2"), OFF_ON),
            "Chopper mode of motor 2: on is stealthChop, which is quiet; off is spreadCycle.";
        C3 "c3": choice().with(IDLE), 1,
            words(text!("stealthchop m3"), OFF_ON),
            "Chopper mode of motor 3: on is stealthChop, which is quiet; off is spreadCycle.";
        C4 "c4": choice().with(IDLE), 1,
            words(text!("stealthchop m4"), OFF_ON),
            "Chopper mode of motor 4: on is stealthChop, which is quiet; off is spreadCycle.";
        S1 "s1": whole(cold(0), 255).with(IDLE), 0,
            words(text!("stall threshold m1"), NONE),
            "Stall threshold of motor 1 for [homing X by a stall](rp2040.md#homing-by-a-stall). A higher value detects a stall sooner. 0: off.";
        S2 "s2": whole(cold(0), 255).with(IDLE), 0,
            words(text!("stall threshold m2"), NONE),
            "Stall threshold of motor 2 for [homing Y by a stall](rp2040.md#homing-by-a-stall). A higher value detects a stall sooner. 0: off.";
        S3 "s3": whole(cold(0), 255).with(IDLE), 0,
            words(text!("stall threshold m3"), NONE),
            "Stall threshold of motor 3 for [homing Z by a stall](rp2040.md#homing-by-a-stall). A higher value detects a stall sooner. 0: off.";
    }
}
