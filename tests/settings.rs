//! `cargo xtask settings` with the firmware on the host: saved settings can be loaded into another machine, whatever
//! its units and its dialect.

#[path = "../xtask/src/settings/json.rs"]
#[allow(dead_code)]
mod json;
#[path = "../xtask/src/settings/session.rs"]
mod session;

use json::Json;
use kerf::hal::imp::Machine;
use session::{Line, load, save};

/// Longest wait for an answer, ms of the machine's time.
const ANSWER_MS: u64 = 2_000;

struct Host {
    machine: Machine,
    heard: String,
    /// Number of lines that are still sent. When it is 0 the power has failed.
    lines_left: usize,
}

impl Host {
    fn boot() -> Self {
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        machine.run_ms(200);
        machine.received();
        Host { machine, heard: String::new(), lines_left: usize::MAX }
    }

    fn tell(&mut self, line: &str) {
        self.ask(line);
    }
}

impl Line for Host {
    fn ask(&mut self, line: &str) -> Option<String> {
        self.lines_left = self.lines_left.checked_sub(1)?;
        self.machine.send(format!("{line}\n").as_bytes());
        for _ in 0..ANSWER_MS {
            self.machine.run_ms(1);
            self.heard += &String::from_utf8_lossy(&self.machine.received());
            while let Some((heard, rest)) = self.heard.split_once('\n') {
                let (heard, rest) = (heard.trim().to_string(), rest.to_string());
                self.heard = rest;
                if heard.starts_with("{\"r\":") || heard.starts_with("{r:") {
                    return Some(heard);
                }
            }
        }
        None
    }

    fn restart(&mut self) -> Result<(), String> {
        self.machine.run_ms(500);
        Ok(())
    }
}

/// Runs something in a thread of its own, because each thread has one machine.
fn with_machine<T: Send>(what: impl FnOnce(&mut Host) -> T + Send) -> T {
    std::thread::scope(|scope| {
        scope.spawn(|| what(&mut Host::boot())).join().expect("the machine works")
    })
}

const CHANGES: [&str; 13] = [
    "{mch:1}",
    "{1tr:39.5,1po:1,4ma:1}",
    "{x:{vm:3210,fr:1234.5,tn:-1.5,tm:287.25}}",
    "{zsx:3,st:1,sl:1,saf:2,mt:7.5}",
    "{p1:{frq:1000,csh:24000,pof:0},spde:2.5,coph:1}",
    "{g54:{x:10.1234,y:-20,z:3},g593:{c:45}}",
    "{tt1:{x:1,z:50.25},tt10:{z:-3}}",
    "{uda0:\"0x2a\",udd3:\"0xffffffff\"}",
    "{si:250,jd:0}",
    "g28.3 x12.5 y7 z-3",
    "g28.1",
    "{psw:0,gun:0}",
    "{isx:42.5,ist:1,isd:0.05,drr1:0.7,xbl:0.05}",
];

fn saved_machine(more: &[&str]) -> Json {
    with_machine(|host| {
        CHANGES.iter().chain(more).for_each(|line| host.tell(line));
        save(host).expect("it can be saved")
    })
}

/// Checks that two files agree, except for what the machine is, which no file changes.
fn assert_same(a: &Json, b: &Json) {
    for (group, members) in a.members() {
        for (name, value) in members.members() {
            let other = b.get(group).and_then(|group| group.get(name));
            assert!(
                other.is_some_and(|other| other.is_same(value)),
                "{group} {name}: {value} {other:?}"
            );
        }
    }
}

#[test]
fn what_is_saved_is_loaded_into_another_machine() {
    let file = saved_machine(&[]);
    let text = file.to_string();
    let file = Json::parse(&text).expect("JSON");
    assert_eq!(file.get("g28").and_then(|g| g.get("x")).and_then(Json::number), Some(12.5));
    let again = with_machine(|host| {
        let wrong = load(host, &file).expect("it can be loaded");
        assert!(wrong.is_empty(), "{wrong:?}");
        save(host).expect("it can be saved")
    });
    assert_same(&file, &again);
}

#[test]
fn units_and_manners_are_of_no_account() {
    let file = saved_machine(&[]);
    for manners in
        [["g20", "{jv:0}"], ["{js:0}", "{rxm:0}"], ["{ec:1}", "{ee:1}"], ["{dia:1}", "{jv:1}"]]
    {
        let again = with_machine(|host| {
            manners.iter().for_each(|line| host.tell(line));
            let wrong = load(host, &file).expect("it can be loaded");
            assert!(wrong.is_empty(), "{manners:?}: {wrong:?}");
            save(host).expect("it can be saved")
        });
        assert_same(&file, &again);
        let same = saved_machine(&manners);
        let x = |file: &Json| file.get("x").expect("x").clone();
        assert_eq!(x(&same), x(&file), "{manners:?}");
    }
}

#[test]
fn a_power_cut_in_the_middle_leaves_each_value_old_or_new() {
    let file = saved_machine(&[]);
    let factory = with_machine(|host| save(host).expect("it can be saved"));
    for lines in [5, 12, 20, 33, 50, 70] {
        let cut = with_machine(|host| {
            host.lines_left = lines;
            assert!(load(host, &file).is_err());
            host.lines_left = usize::MAX;
            let cut = save(host).expect("it can be saved");
            // A second load succeeds.
            let wrong = load(host, &file).expect("it can be loaded");
            assert!(wrong.is_empty(), "{wrong:?}");
            cut
        });
        for (group, members) in cut.members() {
            for (name, value) in members.members() {
                let of = |file: &Json| file.get(group).and_then(|g| g.get(name)).cloned();
                let is_one =
                    [of(&file), of(&factory)].iter().flatten().any(|one| one.is_same(value));
                // A machine profile sets axes and motors at once.
                let of_profile = group.len() == 1;
                assert!(is_one || of_profile, "{lines}: {group} {name} {value}");
            }
        }
    }
}

#[test]
fn a_machine_that_does_not_rest_is_left_alone() {
    let file = saved_machine(&[]);
    let refused = with_machine(|host| {
        host.tell("g1 x100 f100");
        load(host, &file).expect_err("it moves")
    });
    assert_eq!(refused, "the machine does not rest: stat is 5");
}

#[test]
fn what_cannot_be_set_is_told() {
    let file = Json::parse(r#"{"6":{"mi":8},"x":{"vm":-1,"fr":900,"nn":1},"sys":{"fb":1,"st":1}}"#)
        .expect("JSON");
    let wrong = with_machine(|host| load(host, &file).expect("it can be loaded"));
    let text = wrong.join("\n");
    assert!(text.contains("x vm:-1 is refused with status 108"), "{text}");
    assert!(text.contains("there is no x nn") && text.contains("there is no 6"), "{text}");
    assert!(!text.contains("fr:") && !text.contains("sys"), "{text}");
}
