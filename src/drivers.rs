//! TMC2209 drivers: the values of their registers, and the datagrams that write and read them. Pure: no pin, no UART.
//!
//! The registers set the microsteps, the currents, the chopper mode, and the load at which the driver raises its pin
//! DIAG. The driver measures the load only in stealthChop mode, and only while a 256th of a step takes at most
//! TCOOLTHRS cycles of the driver's clock. Kerf sets TCOOLTHRS to three quarters of the speed at which the axis
//! searches for its switch, because at lower speeds the load cannot be told from a stall.
//!
//! Registers and datagrams: TMC2209 data sheet, 4.1 (UART datagram structure), 5.1 to 5.5 (register map), 9 (currents),
//! 11 (StallGuard4).

pub mod watch;

use crate::config::Settings;
use crate::config::drive::Drive;

/// The number of registers that Kerf writes to each driver.
pub const REGISTERS: usize = 6;

/// The addresses of GCONF, CHOPCONF, IHOLD_IRUN, TCOOLTHRS, SGTHRS and NODECONF, in the order of [`FIRST`].
const ADDRESSES: [u8; REGISTERS] = [0x00, 0x6C, 0x10, 0x14, 0x40, 0x03];
/// The address of GSTAT.
const GSTAT: u8 = 0x01;
/// The number of bytes of a request to read a register.
pub const REQUEST: usize = 4;
/// The number of bytes of a datagram that writes a register, and of an answer.
pub const DATAGRAM: usize = 8;
/// The first byte of each datagram, and the address of the master in answers.
const SYNC: u8 = 0x05;
const MASTER: u8 = 0xFF;
/// NODECONF: a driver waits for 24 bits before it answers, as it has to if several share the line.
const ANSWER_DELAY: u32 = 2 << 8;

/// GCONF: the UART is used instead of the configuration pins, microsteps come from CHOPCONF, step pulses are filtered,
/// and the current does not depend on the pin VREF.
const GCONF: u32 = 1 << 6 | 1 << 7 | 1 << 8;
const SPREAD_CYCLE: u32 = 1 << 2;
/// CHOPCONF: the driver interpolates microsteps to 256. All other bits are as after a reset.
const CHOPCONF: u32 = 1 << 28 | 1 << 16 | 0x53;
const LOW_RANGE: u32 = 1 << 17;
const FIRST_RESOLUTION: u32 = 24;
/// The resolution code 0 stands for 2^8 microsteps. Each higher code halves the number.
const FINEST: u32 = 8;
/// IHOLD_IRUN: the current falls from its value in motion to its value at standstill in an eighth of a second or more.
const HOLD_DELAY: u32 = 8 << 16;
/// The current of a full 32 counts with sense resistors of 0.11 ohms, mA (RMS), in the low and in the high range.
const LOW_FULL: u32 = 979;
const HIGH_FULL: u32 = 1_768;
/// The internal clock of a driver, Hz.
const OWN_HZ: f32 = 12e6;
/// The greatest value of TCOOLTHRS, which has 20 bits.
const SLOWEST: u32 = 0xF_FFFF;
/// A stall is reported from this share of the search speed upwards.
const SHARE: f32 = 0.75;
/// Units of [`Length`](crate::units::Length) in a millimetre or a degree.
const UNITS: f32 = 1e4;

/// The values of the registers until settings have been read.
pub const FIRST: [u32; REGISTERS] = values(&Drive::DEFAULT, 8, 0);

/// Returns the register values of a driver. `slowest` is the longest time of a 256th of a step at which a stall counts,
/// in cycles of the driver's clock.
const fn values(drive: &Drive, microsteps: u8, slowest: u32) -> [u32; REGISTERS] {
    let (run, hold) = (drive.run as u32, drive.hold as u32);
    let is_low = run <= LOW_FULL && hold <= LOW_FULL;
    let (range, full) = if is_low { (LOW_RANGE, LOW_FULL) } else { (0, HIGH_FULL) };
    let chopper = if drive.quiet { 0 } else { SPREAD_CYCLE };
    let finer = if microsteps == 0 { 0 } else { microsteps.ilog2() };
    [
        GCONF | chopper,
        CHOPCONF | range | (FINEST - finer) << FIRST_RESOLUTION,
        HOLD_DELAY | counts(run, full) << 8 | counts(hold, full),
        if drive.stall == 0 { 0 } else { slowest },
        drive.stall as u32,
        ANSWER_DELAY,
    ]
}

/// Returns the register value, 0 to 31, of the count nearest to a current. The value n stands for n + 1 counts.
const fn counts(current: u32, full: u32) -> u32 {
    let counts = (current * 32 + full / 2) / full;
    if counts == 0 {
        0
    } else if counts > 32 {
        31
    } else {
        counts - 1
    }
}

/// Returns the register values for the driver of a motor, computed from the settings. Cost: two divisions of floats.
pub fn registers(settings: &Settings, motor: usize) -> [u32; REGISTERS] {
    let drive = settings.drives.get(motor).copied().unwrap_or(Drive::DEFAULT);
    values(&drive, settings.motor_microsteps(motor), slowest(settings, motor))
}

/// Returns how many cycles of a driver's clock a 256th of a step takes at the slowest speed at which the driver reports
/// a stall. The DIAG pin of motor n serves as the limit switch of axis n, so the search speed of axis n counts.
fn slowest(settings: &Settings, motor: usize) -> u32 {
    let speed = settings.search_velocity(motor).min(settings.velocity_max(motor)) * SHARE;
    let ratio = settings.step_ratio(motor);
    let parts = 256.0 / f32::from(settings.motor_microsteps(motor).max(1));
    let of_unit = ratio.num as f32 / ratio.den as f32 * parts;
    let cycles = OWN_HZ * 60.0 / (speed * UNITS * of_unit);
    // A speed of 0 makes `cycles` infinite. The cast saturates, and the minimum limits it.
    (cycles as u32).min(SLOWEST)
}

/// Returns the datagram that writes a register of the driver with the given address. `number` is the index of the
/// register, below [`REGISTERS`]. Cost on a Cortex-M0+: 1,000 cycles.
pub fn datagram(address: u8, number: usize, value: u32) -> [u8; DATAGRAM] {
    write(address, ADDRESSES.get(number).copied().unwrap_or(0), value)
}

/// Returns the datagram that clears GSTAT.
pub fn clearing(address: u8) -> [u8; DATAGRAM] {
    write(address, GSTAT, watch::CLEARS)
}

fn write(address: u8, register: u8, value: u32) -> [u8; DATAGRAM] {
    let [a, b, c, d] = value.to_be_bytes();
    let mut datagram = [SYNC, address, register | 0x80, a, b, c, d, 0];
    datagram[7] = checksum(&datagram[..7]);
    datagram
}

/// Returns the request to read a register.
pub fn request(address: u8, asked: watch::Asked) -> [u8; REQUEST] {
    let mut request = [SYNC, address, asked as u8, 0];
    request[3] = checksum(&request[..3]);
    request
}

/// Returns the value in an answer. `heard` is what has come since the request: first the request itself, because both
/// share the line, then the answer. `None` if no valid answer is at its end.
pub fn answer(heard: &[u8], asked: watch::Asked) -> Option<u32> {
    let answer = heard.get(heard.len().checked_sub(DATAGRAM)?..)?;
    match *answer {
        [SYNC, MASTER, register, a, b, c, d, sum]
            if register == asked as u8 && checksum(&answer[..7]) == sum =>
        {
            Some(u32::from_be_bytes([a, b, c, d]))
        }
        _ => None,
    }
}

/// Returns the CRC with the polynomial x^8 + x^2 + x + 1. It takes the lowest bit of each byte first.
fn checksum(bytes: &[u8]) -> u8 {
    let mut crc = 0u8;
    for byte in bytes {
        for bit in 0..8 {
            let over = (crc >> 7) ^ (byte >> bit & 1);
            crc = crc << 1 ^ if over != 0 { 0x07 } else { 0 };
        }
    }
    crc
}

#[cfg(test)]
#[cfg(feature = "drivers")]
mod tests {
    use super::*;
    use crate::config::{Name, Number, Setting};

    fn set(settings: &mut Settings, name: &str, value: &str) {
        let setting = Setting::find(&Name::new().with(name.as_bytes()).unwrap()).unwrap();
        let number = Number::parse(value.as_bytes()).unwrap();
        let value = settings.check(setting, number, false).unwrap();
        settings.store(setting, value);
    }

    fn drive(run: u16, hold: u16) -> Drive {
        Drive { run, hold, ..Drive::DEFAULT }
    }

    #[test]
    fn a_datagram_is_that_of_the_data_sheet() {
        assert_eq!(FIRST, [0x1C0, 0x1503_0053, 0x0008_1209, 0, 0, 0x200]);
        assert_eq!(datagram(2, 0, 0x1C0)[..7], [5, 2, 0x80, 0, 0, 1, 0xC0]);
        // A request to read GCONF.
        assert_eq!(checksum(&[5, 0, 0]), 0x48);
    }

    #[test]
    fn only_a_whole_answer_to_the_question_counts() {
        let asked = watch::Asked::Taken;
        let mut answered = [5, 0xFF, 2, 0, 0, 0, 77, 0];
        answered[7] = checksum(&answered[..7]);
        let mut heard = request(3, asked).to_vec();
        assert_eq!(answer(&heard, asked), None);
        heard.extend(answered);
        assert_eq!(answer(&heard, asked), Some(77));
        assert_eq!(answer(&answered, asked), Some(77), "without an echo");
        assert_eq!(answer(&heard, watch::Asked::Global), None);
        assert_eq!(answer(&heard[..11], asked), None);
        heard[10] ^= 1;
        assert_eq!(answer(&heard, asked), None);
    }

    #[test]
    fn currents_are_the_nearest_of_the_finer_range() {
        for (run, hold, low, counts) in [
            (50, 50, true, (1, 1)),
            (580, 310, true, (18, 9)),
            (979, 50, true, (31, 1)),
            (980, 310, false, (17, 5)),
            (310, 1_000, false, (5, 17)),
            (1_400, 1_400, false, (24, 24)),
            (u16::MAX, 0, false, (31, 0)),
        ] {
            let [_, chopper, currents, ..] = values(&drive(run, hold), 8, 0);
            assert_eq!(chopper & LOW_RANGE != 0, low, "{run} {hold}");
            assert_eq!((currents >> 8 & 0xFF, currents & 0xFF), counts, "{run} {hold}");
        }
    }

    #[test]
    fn microsteps_are_a_resolution() {
        let resolution = |microsteps| values(&Drive::DEFAULT, microsteps, 0)[1] >> 24 & 0xF;
        assert_eq!([1, 2, 8, 16, 128].map(resolution), [8, 7, 5, 4, 1]);
        assert_eq!([0, 3, 255].map(resolution), [8, 7, 1], "never beyond");
    }

    #[test]
    fn a_stall_counts_from_three_quarters_of_the_search_on() {
        let mut settings = Settings::new();
        settings.drives[0].stall = 90;
        // 600 mm/min are 8 turns of 1.25 mm a second, or 409,600 256ths of a step a second.
        for (name, value) in [("xvm", "800"), ("xsv", "600")] {
            set(&mut settings, name, value);
        }
        let told = |settings: &Settings| registers(settings, 0)[3..5].to_vec();
        assert_eq!(told(&settings), [39, 90]);
        set(&mut settings, "1mi", "32");
        assert_eq!(told(&settings), [39, 90], "parts are of full steps");
        set(&mut settings, "xvm", "60");
        assert_eq!(told(&settings), [390, 90], "no axis searches faster than it goes");
        set(&mut settings, "xsv", "0.001");
        assert_eq!(told(&settings), [SLOWEST, 90]);
        settings.drives[0].stall = 0;
        assert_eq!(told(&settings), [0, 0]);
    }
}
