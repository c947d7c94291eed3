//! Power fails at each byte that the EEPROM is given, and what is there at the next start.

use std::collections::BTreeSet;

use kerf::config::{Setting, Settings};
use kerf::hal::eeprom::Eeprom;
use kerf::hal::imp::eeprom;
use kerf::store::{Log, Memory, kept};

use crate::kept_machine::{Sender, with};

impl Sender {
    /// Returns a value.
    fn value(&mut self, name: &str) -> String {
        let heard = self.ask(&format!("{{{name}:n}}\n"), 20);
        let (_, value) =
            heard.split_once(&format!("\"{name}\":")).unwrap_or_else(|| panic!("{heard}"));
        value.split(['}', ',']).next().unwrap().to_string()
    }

    /// Waits until all settings are stored.
    fn wait(&mut self) {
        while self.value("kept") == "0" {}
    }
}

/// What the EEPROM holds when power fails at each byte. The last byte that was written has any value then.
struct Cuts {
    old: Vec<u8>,
    written: Vec<(u16, u8)>,
}

impl Cuts {
    /// Stores the lines of `before`, with a start for each, then notes what is written for `lines`.
    fn of(before: &[&'static str], lines: &'static [&str], ms: u64) -> Self {
        let mut old = Vec::new();
        for &line in before {
            old = with(&old, move |sender| {
                sender.ask(&format!("{line}\n"), 5_000);
                eeprom::contents()
            });
        }
        with(&old, move |sender| {
            let old = eeprom::contents();
            for line in lines {
                sender.ask(&format!("{line}\n"), 30);
            }
            sender.ask("", ms);
            Cuts { old, written: eeprom::take_written() }
        })
    }

    fn images(&self) -> impl Iterator<Item = Vec<u8>> {
        let mut image = self.old.clone();
        let mut torn = 0x35u8;
        std::iter::once(image.clone()).chain(self.written.iter().map(move |(at, byte)| {
            let mut cut = image.clone();
            torn = torn.wrapping_mul(5).wrapping_add(99);
            cut[usize::from(*at)] = if torn.is_multiple_of(4) { torn } else { *byte };
            image[usize::from(*at)] = *byte;
            cut
        }))
    }
}

/// The EEPROM as it was left.
struct Left(Vec<u8>);

impl Memory for Left {
    const SIZE: u16 = Eeprom::SIZE;
    const LOG: u16 = Eeprom::LOG;
    fn read(&self, at: u16) -> u8 {
        self.0[usize::from(at)]
    }
    fn is_busy(&self) -> bool {
        false
    }
    fn write(&mut self, at: u16, byte: u8) {
        self.0[usize::from(at)] = byte;
    }
}

/// All settings that are in RAM and kept.
fn kept_settings() -> impl Iterator<Item = Setting> {
    (0..kept::ITEMS).filter_map(Setting::from_number).filter(|setting| setting.is_kept())
}

/// The settings as a start finds them.
fn found(image: &[u8]) -> Vec<i32> {
    let (memory, mut settings) = (Left(image.to_vec()), Settings::new());
    kept::load(&Log::open(&memory), &memory, &mut settings);
    kept_settings().map(|setting| settings.get(setting)).collect()
}

#[test]
fn a_change_of_all_settings_is_not_half_done() {
    let changes: [(&[&str], &[&str]); 4] = [
        (&["{xvm:900,4mi:32,si:200}"], &["{mch:1}"]),
        (&["{mch:1}", "{xvm:900,si:300}"], &["{mch:3}"]),
        (&["{mch:3}", "{xvm:900,4mi:32,si:200}", "{p1frq:200}"], &["{defa:1}"]),
        (&["{mch:2}"], &["{mch:4}", "{mch:1}"]),
    ];
    for (before, lines) in changes {
        let cuts = Cuts::of(before, lines, 6_000);
        let images: Vec<_> = cuts.images().collect();
        let (old, new) = (found(&images[0]), found(images.last().unwrap()));
        assert_ne!(old, new);
        let mut seen = BTreeSet::new();
        for (at, image) in images.iter().enumerate() {
            let is = found(image);
            // A second change may cut the first one short.
            let is_other = lines.len() > 1 && is != old && is != new;
            assert!(is == old || is == new || is_other, "{lines:?}: mixed at byte {at}");
            seen.insert(is);
        }
        assert_eq!(seen.len(), 1 + lines.len(), "{lines:?}");
        // The start finishes the change.
        for image in images.iter().step_by(images.len() / 6) {
            let is = found(image);
            let kept = with(image, |sender| {
                sender.wait();
                eeprom::contents()
            });
            assert_eq!(found(&kept), is, "{lines:?}");
            let (memory, mut settings) = (Left(kept), Settings::new());
            let change = kept::load(&Log::open(&memory), &memory, &mut settings);
            assert_eq!(change, kept::Change::NONE);
        }
    }
}

#[test]
fn settings_in_eeprom_alone_are_reset_with_the_others() {
    let cuts = Cuts::of(&["{p1frq:200,uda0:\"0x1\"}", "{xvm:900}"], &["{defa:1}"], 4_000);
    let images: Vec<_> = cuts.images().collect();
    let mut seen = BTreeSet::new();
    for image in images.iter().step_by(9) {
        let is = with(image, |sender| ["p1frq", "uda0", "xvm"].map(|name| sender.value(name)));
        seen.insert(is);
    }
    let old = ["200", "\"0x1\"", "900"].map(str::to_string);
    let new = ["1000", "\"0x0\"", "800"].map(str::to_string);
    assert_eq!(seen, BTreeSet::from([new, old]));
}

/// `$RST=*` restores settings and offsets, or neither.
#[test]
fn offsets_are_reset_with_the_settings() {
    let before = &["{dia:3}", "$110=900", "G10L2P1X3Y4", "G10L2P6Z5", "$p1frq=200"];
    let cuts = Cuts::of(before, &["$RST=*"], 5_000);
    let images: Vec<_> = cuts.images().collect();
    let mut seen = BTreeSet::new();
    for image in images.iter().step_by(7).chain(images.last()) {
        let is = with(image, |sender| {
            let heard =
                sender.ask("$I\n", 100) + &sender.ask("$#\n", 300) + &sender.ask("$$\n", 400);
            sender.0.run_ms(2_000);
            let later = sender.ask("$#\n", 300) + &sender.ask("$p1frq\n", 300);
            let wanted = ["[G54:", "[G59:", "$110="];
            let is = |line: &&str| wanted.iter().any(|name| line.starts_with(name));
            let texts =
                [&heard, &later].map(|text| text.lines().filter(is).collect::<Vec<_>>().join(" "));
            let frequency =
                later.lines().find(|line| line.starts_with("$p1frq") || line.contains("p1frq"));
            let frequency = frequency.map(|line| line.contains("200"));
            (texts[0].clone(), texts[1].clone(), frequency)
        });
        seen.insert(is);
    }
    assert_eq!(seen.len(), 2, "{seen:#?}");
}

#[test]
fn a_setting_behind_a_change_of_machine_is_not_lost_with_it() {
    let cuts = Cuts::of(&["{mch:1}"], &["{mch:2}", "{xvm:777}"], 6_000);
    let xvm = kept_settings().position(|setting| setting.name().bytes() == b"xvm").unwrap();
    let images: Vec<_> = cuts.images().collect();
    let (old, new) = (found(&images[0]), found(images.last().unwrap()));
    assert_eq!(new[xvm], 777_000);
    let mut was_set = false;
    for image in &images {
        let mut is = found(image);
        was_set |= is[xvm] == 777_000;
        assert!(!was_set || is[xvm] == 777_000);
        is[xvm] = if is == old { old[xvm] } else { 777_000 };
        assert!(is == old || is == new);
    }
    assert!(was_set);
}

/// A velocity that was lowered because of another setting is lowered at the start, too.
#[test]
fn a_velocity_is_never_beyond_what_the_motor_follows() {
    let cuts = Cuts::of(&["{xvm:3000}"], &["{1mi:64}"], 2_000);
    let pairs = cuts.images().map(|image| {
        with(&image, |sender| ["1mi", "xvm"].map(|name| sender.value(name).parse::<u32>().unwrap()))
    });
    let pairs: Vec<_> = pairs.collect::<BTreeSet<_>>().into_iter().collect();
    assert_eq!(pairs, [[8, 3_000], [64, 586]]);
}

#[test]
fn a_start_up_line_is_the_old_one_or_the_new() {
    let cuts = Cuts::of(&["{dia:3}", "$N0=G20", "$N1=G55"], &["$N0=G21G54"], 2_000);
    let mut seen = BTreeSet::new();
    for image in cuts.images() {
        seen.insert(with(&image, |sender| sender.ask("$N\n", 100)));
    }
    let seen: Vec<_> = seen.into_iter().collect();
    let expected = ["G20", "G21G54"].map(|line| format!("$N0={line}\r\n$N1=G55\r\nok\r\n"));
    assert_eq!(seen, expected);
}

#[test]
fn a_stored_program_is_the_old_one_or_the_new() {
    let old = "{prog:f}\n{prog:\"G0 X1\"}\n{prog:t}";
    let new = &["{prog:f}\n{prog:\"G0 Y2\"}\n{prog:\"M2\"}\n{prog:t}"];
    let cuts = Cuts::of(&[old], new, 2_000);
    let mut seen = BTreeSet::new();
    for image in cuts.images() {
        seen.insert(with(&image, |sender| sender.value("prog")));
    }
    assert_eq!(seen.into_iter().collect::<Vec<_>>(), ["\"G0 X1\\n\"", "\"G0 Y2\\nM2\\n\""]);
}

#[test]
fn unreadable_settings_are_an_alarm_until_it_is_cleared() {
    for clear in ["{clear:n}\n", "{xvm:900}\n{clear:n}\n"] {
        with([0x55; 4_096], move |sender| {
            assert_eq!(sender.value("stat"), "2");
            assert!(sender.ask("g1 f500 x1\n", 100).contains(",203,"), "nothing moves");
            assert!(sender.ask("{mch:1}\n", 100).contains("\"f\":[1,0,"), "settings can be loaded");
            sender.ask(clear, 200);
            assert_eq!(sender.value("stat"), "1");
            sender.ask("g1 f500 x1\n", 500);
            assert_eq!(sender.value("posx"), "1.000");
        });
    }
}
