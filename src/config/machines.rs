//! Machine profiles: the values of the settings on a router, a mill, a printer, a lathe.
//!
//! A profile is one constant in one file under `machines/`. It lists the settings in which the machine differs from the
//! careful machine. The careful machine's own file lists its differences from TinyG. Names, ranges and decimals are
//! checked when the image is built. Each difference takes six bytes of program memory. A difference that X and Y share
//! counts once.
//!
//! An image is built for the profile [`ACTIVE`], whose values are its defaults. `{mch:2}` switches to the values of
//! another profile ([`Settings::take_over`](super::Settings::take_over)). In the table of such an image the place of its
//! own profile has the way back to the careful machine. So the profile of an image adds only a few bytes
//! ([`ADDS`]).

use core::ops::Range;

use super::groups::{axis, motor, system};
use super::setting::{Owner, Setting};
use super::table::{self, HOMING, RADIUS, SettingRow, Values, row_of};
use crate::boards::MOTORS;
use crate::progmem;
use crate::units::{AXES, FIRST_ROTARY};

#[path = "../../machines/careful.rs"]
mod careful;
#[path = "../../machines/lathe.rs"]
mod lathe;
#[path = "../../machines/mill.rs"]
mod mill;
#[path = "../../machines/printer.rs"]
mod printer;
#[path = "../../machines/router.rs"]
mod router;

pub(super) use careful::CAREFUL;
use lathe::LATHE;
use mill::MILL;
use printer::PRINTER;
use router::ROUTER;

/// The profile of a machine.
#[derive(Debug)]
pub struct MachineProfile {
    /// The name for the option `--machine`.
    pub name: &'static str,
    /// A short description.
    pub about: &'static str,
    /// The settings that differ from those of the careful machine.
    pub entries: &'static [Entry],
}

/// All profiles, in the order of their numbers, which are the values of `mch`.
pub const ALL: [&MachineProfile; COUNT] = [&CAREFUL, &ROUTER, &MILL, &PRINTER, &LATHE];
/// The number of profiles.
pub const COUNT: usize = 5;

/// The number of the profile that this image is built for.
pub const ACTIVE: u8 = if cfg!(feature = "machine-router") {
    1
} else if cfg!(feature = "machine-mill") {
    2
} else if cfg!(feature = "machine-printer") {
    3
} else if cfg!(feature = "machine-lathe") {
    4
} else {
    0
};

/// The number of the setting that chooses a profile.
pub(super) const CHOICE: u8 = row_of(&system::LIST, "mch");

/// One setting in a profile, for the machine itself or for several of its motors or axes.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// The number of the setting; for motors and axes, that of the first one.
    setting: u8,
    /// The motors or axes, as bits; 1 for the machine itself.
    owners: u8,
    /// The value, scaled as stored.
    value: i32,
}

impl Entry {
    const NONE: Entry = Entry { setting: 0, owners: 0, value: 0 };

    /// Returns the setting; for motors and axes, that of the first one.
    pub(super) fn first(&self) -> Setting {
        Setting::of_entry(self.setting)
    }

    /// Returns the owners of the setting.
    pub(super) fn owners(&self) -> impl Iterator<Item = Owner> {
        let (first, owners) = (self.first().owner(), self.owners);
        let numbers = (0..u8::BITS as u8).filter(move |number| owners >> number & 1 != 0);
        numbers.map(move |number| first.numbered(number))
    }

    /// Returns the value, scaled as stored.
    pub(super) fn value(&self) -> i32 {
        self.value
    }
}

/// Makes an entry for the setting `name` of the owners that `owners` lists: `"xy"`, `"14"`, or `""` for the machine
/// itself. `value` is in the setting's own unit.
///
/// Panics, and so fails the build, if there is no such setting or it cannot have the value.
const fn set(owners: &str, name: &str, value: f64) -> Entry {
    let owners = owners.as_bytes();
    if owners.is_empty() {
        let row = row_of(&system::LIST, name) as usize;
        return entry(row, 1, &system::LIST[row], value);
    }
    if owners[0].is_ascii_digit() {
        let row = row_of(&motor::LIST, name) as usize;
        return entry(system::COUNT + row, bits(owners, b"1234"), &motor::LIST[row], value);
    }
    let row = row_of(&axis::LIST, name) as usize;
    let bits = bits(owners, b"xyzabc");
    let homes = (1 << (FIRST_ROTARY + 1)) - 1;
    let turns = !((1 << FIRST_ROTARY) - 1);
    assert!(!axis::LIST[row].is(HOMING) || bits & !homes == 0, "an axis lacks this setting");
    assert!(!axis::LIST[row].is(RADIUS) || bits & !turns == 0, "an axis lacks this setting");
    entry(system::COUNT + MOTORS * motor::COUNT + row, bits, &axis::LIST[row], value)
}

const fn entry(setting: usize, owners: u8, row: &SettingRow, value: f64) -> Entry {
    let mut scaled = value;
    let mut decimals = row.stored;
    while decimals > 0 {
        scaled *= 10.0;
        decimals -= 1;
    }
    let value = (scaled + if scaled < 0.0 { -0.5 } else { 0.5 }) as i32;
    assert!(value >= row.min && value <= row.max, "a setting of a machine is out of its range");
    Entry { setting: setting as u8, owners, value }
}

/// Returns `owners` as bits, numbered by their order in `all`.
const fn bits(owners: &[u8], all: &[u8]) -> u8 {
    let (mut bits, mut i) = (0, 0);
    while i < owners.len() {
        let mut bit = 0;
        while all[bit] != owners[i] {
            bit += 1;
        }
        bits |= 1 << bit;
        i += 1;
    }
    bits
}

impl Values {
    /// Returns these values, which are those of the careful machine, with the values of another profile.
    pub(super) const fn on(self, machine: u8) -> Values {
        if machine == 0 {
            return self;
        }
        let mut values = self.with(ALL[machine as usize].entries);
        values.system[CHOICE as usize] = machine as i32;
        values
    }

    /// Returns these values with those of `entries` replaced.
    pub(super) const fn with(mut self, entries: &[Entry]) -> Values {
        let mut i = 0;
        while i < entries.len() {
            let Entry { setting, owners, value } = entries[i];
            let mut owner = 0;
            while owner < AXES {
                if owners >> owner & 1 != 0 {
                    self.put(setting as usize, owner, value);
                }
                owner += 1;
            }
            i += 1;
        }
        self
    }

    const fn get(&self, setting: usize, owner: usize) -> i32 {
        if setting < system::COUNT {
            self.system[setting]
        } else if setting < FIRST_AXIS {
            self.motor[setting - system::COUNT][owner]
        } else {
            self.axis[setting - FIRST_AXIS][owner]
        }
    }

    const fn put(&mut self, setting: usize, owner: usize, value: i32) {
        if setting < system::COUNT {
            self.system[setting] = value;
        } else if setting < FIRST_AXIS {
            self.motor[setting - system::COUNT][owner] = value;
        } else {
            assert!(setting - FIRST_AXIS < axis::COUNT);
            self.axis[setting - FIRST_AXIS][owner] = value;
        }
    }
}

/// The number of the first setting of an axis.
const FIRST_AXIS: usize = system::COUNT + MOTORS * motor::COUNT;

/// Returns the bits of the owners in an entry to which the careful machine gives the same value as to `owner`.
const fn alike(entry: &Entry, owner: usize) -> u8 {
    let setting = entry.setting as usize;
    let (mut bits, mut other) = (0, 0);
    while other < AXES {
        let is = entry.owners >> other & 1 != 0
            && table::CAREFUL.get(setting, other) == table::CAREFUL.get(setting, owner);
        bits |= (is as u8) << other;
        other += 1;
    }
    bits
}

/// Returns the number of entries that lead from a profile back to the careful machine.
const fn count_back(machine: usize) -> usize {
    let (entries, mut count, mut i) = (ALL[machine].entries, 0, 0);
    while machine != 0 && i < entries.len() {
        let mut owners = entries[i].owners;
        while owners != 0 {
            owners &= !alike(&entries[i], owners.trailing_zeros() as usize);
            count += 1;
        }
        i += 1;
    }
    count
}

/// Where the entries of each machine end in [`ENTRIES`]. The careful machine has none there. Those of [`ACTIVE`] lead
/// back to the careful machine.
const ENDS: [u8; COUNT] = {
    let (mut ends, mut machine) = ([0; COUNT], 1);
    while machine < COUNT {
        let count = match machine == ACTIVE as usize {
            true => count_back(machine),
            false => ALL[machine].entries.len(),
        };
        let end = ends[machine - 1] as usize + count;
        assert!(end <= u8::MAX as usize, "the machines have too many settings");
        ends[machine] = end as u8;
        machine += 1;
    }
    ends
};

type Entries = [Entry; ENDS[COUNT - 1] as usize];

const fn joined() -> Entries {
    let mut all = [Entry::NONE; ENDS[COUNT - 1] as usize];
    let mut machine = 1;
    while machine < COUNT {
        let at = ENDS[machine - 1] as usize;
        all = match machine == ACTIVE as usize {
            true => put_back(all, at),
            false => put_on(all, at, machine),
        };
        machine += 1;
    }
    all
}

/// Puts the entries of a profile into `all` from `at` on.
const fn put_on(mut all: Entries, at: usize, machine: usize) -> Entries {
    let (entries, mut i) = (ALL[machine].entries, 0);
    while i < entries.len() {
        all[at + i] = entries[i];
        i += 1;
    }
    all
}

/// Puts the entries that lead from [`ACTIVE`] back to the careful machine into `all` from `at` on.
const fn put_back(mut all: Entries, mut at: usize) -> Entries {
    let (entries, mut i) = (ALL[ACTIVE as usize].entries, 0);
    while i < entries.len() {
        let Entry { setting, owners: mut left, .. } = entries[i];
        while left != 0 {
            let owner = left.trailing_zeros() as usize;
            let owners = alike(&entries[i], owner) & left;
            let value = table::CAREFUL.get(setting as usize, owner);
            all[at] = Entry { setting, owners, value };
            (left, at) = (left & !owners, at + 1);
        }
        i += 1;
    }
    all
}

/// The most bytes of an entry's table that the profile of an image adds: entries that lead back, in the place of its
/// own ones.
pub const ADDS: usize = {
    let (mut most, mut machine) = (0, 1);
    while machine < COUNT {
        let (back, own) = (count_back(machine), ALL[machine].entries.len());
        most = if back > own + most { back - own } else { most };
        machine += 1;
    }
    most * size_of::<Entry>()
};

const _: () = assert!(ADDS <= 60, "the way back takes more than `caps::PROFILE` has room for");

/// By row of the system: 1 if the profiles differ in this setting.
const fn of_machines() -> [u8; system::COUNT] {
    let (entries, mut rows, mut i) = (joined(), [0; system::COUNT], 0);
    while i < entries.len() {
        let row = entries[i].setting as usize;
        if row < system::COUNT {
            rows[row] = 1;
        }
        i += 1;
    }
    rows
}

progmem! {
    static ENTRIES: [Entry; ENDS[COUNT - 1] as usize] = joined();
    static END_OF: [u8; COUNT] = ENDS;
    static OF_MACHINES: [u8; system::COUNT] = of_machines();
}

/// Returns the value of the first of these entries that sets `setting`. About 30 cycles an entry on AVR.
#[inline(never)]
#[small]
fn first_of(setting: Setting, mut entries: Range<u8>) -> Option<i32> {
    let (first, owner) = setting.first_of_row();
    let first = first.number();
    entries.find_map(|index| {
        let entry = ENTRIES.at(index.into())?;
        (entry.setting == first && entry.owners & owner != 0).then_some(entry.value)
    })
}

/// Returns the value of a setting in the entries of a profile; `None` if there is none. About 1,000 cycles on AVR.
#[small]
pub(super) fn value(machine: u8, setting: Setting) -> Option<i32> {
    first_of(setting, range(machine))
}

/// Returns the range of a profile's entries in [`ENTRIES`].
#[small]
fn range(machine: u8) -> Range<u8> {
    let machine = usize::from(machine);
    let begin = machine.checked_sub(1).and_then(|before| END_OF.at(before)).unwrap_or(0);
    begin..END_OF.at(machine).unwrap_or(0)
}

/// Returns the entries in which a profile differs from the careful machine. Those of [`ACTIVE`] are the way back.
pub(super) fn differences(machine: u8) -> impl Iterator<Item = Entry> {
    range(machine).filter_map(|index| ENTRIES.at(index.into()))
}

/// Whether the profiles differ in this setting of the system.
pub(super) fn is_of_machine(row: usize) -> bool {
    OF_MACHINES.at(row).is_some_and(|yes| yes != 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Name, Settings};
    use crate::motion::pace::Drivers;
    use std::collections::HashSet;
    use std::vec::Vec;

    fn setting(name: &str) -> Setting {
        Setting::find(&Name::new().with(name.as_bytes()).unwrap()).unwrap()
    }

    fn settings_of(machine: u8) -> Settings {
        let mut settings = Settings::new();
        settings.take_over(machine);
        settings
    }

    fn all() -> impl Iterator<Item = Setting> {
        (0..Setting::NUMBERS).filter_map(Setting::from_number)
    }

    fn values(settings: &Settings) -> Vec<i32> {
        all().map(|setting| settings.get(setting)).collect()
    }

    #[test]
    fn every_machine_is_as_its_file_says() {
        let router = settings_of(1);
        let value = |name: &str| router.get(setting(name));
        assert_eq!((value("mch"), value("1tr"), value("3tr")), (1, 40_000_000, 1_250_000));
        assert_eq!((value("4ma"), value("4po"), value("2po")), (1, 1, 0));
        assert_eq!((value("yjm"), value("zjm"), value("ztn")), (4_000_000, 800_000, -60_0000));
        assert_eq!(router.step_ratio(0).steps(crate::units::Length(10_000)), 40);
        let lathe = settings_of(4);
        let value = |name: &str| lathe.get(setting(name));
        assert_eq!((value("yam"), value("gpl"), value("ja")), (0, 1, 72_000_000));
    }

    #[test]
    fn every_setting_is_what_it_is_on_the_machine() {
        for (n, name, settings) in each() {
            for setting in all().filter(|setting| setting.is_kept()) {
                let is = settings.get(setting);
                assert_eq!(is, setting.value_on(n), "{name}: {:?}", setting.name());
            }
        }
    }

    #[test]
    fn settings_that_are_not_the_machines_stay() {
        let mut settings = Settings::new();
        settings.store(setting("si"), 200);
        settings.take_over(3);
        assert_eq!(settings.get(setting("si")), 200);
    }

    /// All profiles: number, name, settings.
    fn each() -> impl Iterator<Item = (u8, &'static str, Settings)> {
        (0..).zip(ALL).map(|(n, machine)| (n, machine.name, settings_of(n)))
    }

    #[test]
    fn whatever_was_chosen_before_makes_no_difference() {
        for (n, name, expected) in each() {
            let mut settings = settings_of((n + 1) % COUNT as u8);
            settings.take_over(n);
            assert_eq!(values(&settings), values(&expected), "{name}");
        }
        assert_eq!(values(&settings_of(ACTIVE)), values(&Settings::new()));
    }

    #[test]
    fn machines_have_values_that_their_settings_can_have() {
        for (_, name, settings) in each() {
            for setting in all().filter(|setting| setting.is_kept()) {
                assert!(setting.accepts(settings.get(setting)), "{name}: {:?}", setting.name());
            }
        }
    }

    #[test]
    fn nothing_is_said_twice_or_in_vain() {
        for machine in ALL {
            let mut seen = HashSet::new();
            for entry in machine.entries {
                for owner in (0..8).filter(|owner| entry.owners >> owner & 1 != 0) {
                    assert!(seen.insert((entry.setting, owner)), "{}: {entry:?}", machine.name);
                }
            }
        }
        for (n, name, _) in each().skip(1) {
            let vain = all().filter(|s| value(n, *s) == Some(s.value_on(0)) && n != ACTIVE);
            let vain = vain.map(Setting::name);
            assert_eq!(vain.collect::<Vec<_>>(), [], "{name}");
        }
    }

    /// The axes that have a motor.
    fn moved(settings: &Settings) -> HashSet<usize> {
        let axes = (0..MOTORS).map(|motor| usize::from(settings.motor_axis(motor)));
        axes.filter(|axis| *axis < AXES).collect()
    }

    #[test]
    fn motors_follow_with_all_others_at_once() {
        let rate = Drivers::USUAL.step_rate_max(MOTORS) as u32;
        for (_, name, mut settings) in each() {
            assert!(!settings.limit_velocity(setting("mch"), |_| rate), "{name}");
        }
    }

    #[test]
    fn ramps_are_neither_a_crawl_nor_a_jolt() {
        for (_, name, settings) in each() {
            for axis in moved(&settings) {
                let accel = settings.accel_max(axis) / 3_600.0;
                let seconds = accel / (settings.jerk_max(axis) / 216_000.0);
                let ramp = settings.velocity_max(axis) / 60.0 / accel + seconds;
                assert!((0.020..0.050).contains(&seconds), "{name} {axis}: {seconds} s");
                assert!((0.05..0.40).contains(&ramp), "{name} {axis}: {ramp} s");
                assert!(settings.jerk_homing(axis) >= settings.jerk_max(axis), "{name} {axis}");
            }
            let idle = all().find(|setting| settings.has_idle_jerk(*setting));
            assert_eq!(idle.map(Setting::name), None, "{name}");
        }
    }

    #[test]
    fn corners_ask_for_no_more_than_ramps() {
        for (_, name, settings) in each() {
            let linear = moved(&settings).into_iter().filter(|axis| *axis < FIRST_ROTARY);
            let most = linear.map(|axis| settings.accel_max(axis)).fold(0.0, f32::max);
            assert!(settings.junction_acceleration() <= most, "{name}");
        }
    }
}
