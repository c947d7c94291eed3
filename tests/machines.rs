//! Machines that are selected at run time, and every built-in job with the default settings of each, on the host.

use kerf::boards::inputs;
use kerf::config::machines::ALL;
use kerf::hal::imp::{Machine, eeprom};
use kerf::jobs::{Job, STORED};

use crate::apart::apart;

/// A machine that was just switched on, with a switch at each end of X, Y and Z, half a turn of the motor away.
fn boot() -> Machine {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    for end in 0..6 {
        machine.set_near(end, if end % 2 == inputs::X_MIN { -800 } else { 800 }, false);
    }
    machine.run_ms(100);
    machine.received();
    machine
}

fn ask(machine: &Machine, line: &str) -> String {
    machine.send(format!("{line}\n").as_bytes());
    machine.run_ms(100);
    String::from_utf8(machine.received()).expect("ASCII")
}

/// Runs a job for at most an hour, and returns the status with which it has ended.
fn run(machine: usize, job: u8) -> String {
    let chip = boot();
    let chosen = ask(&chip, &format!("{{mch:{machine},sv:0}}"));
    assert!(chosen.contains("\"f\":[1,0,"), "{chosen}");
    let begun = ask(&chip, &format!("{{test:{job}}}"));
    assert!(begun.contains("\"f\":[1,0,"), "{begun}");
    let mut heard = begun;
    for _ in 0..3_600 {
        if let Some((_, exception)) = heard.split_once("\"st\":") {
            let end = exception.find('}').unwrap_or(exception.len());
            return exception[..end].to_string();
        }
        chip.run_ms(1_000);
        heard += &String::from_utf8(chip.received()).expect("ASCII");
    }
    format!("does not end: {heard}")
}

const END: &str = "8,\"msg\":\"End of file\"";

/// Returns the error of a job that a machine cannot run; `None` if it can.
fn lacks(machine: &str, job: u8) -> Option<&'static str> {
    match (machine, job) {
        // The job needs G28.2 Y, and arcs in XY.
        ("lathe", 2) => Some("241,\"msg\":\"Homing Error - Bad or no axis specified\""),
        ("lathe", 4 | 9) => Some("137,\"msg\":\"Axis is disabled\""),
        _ => None,
    }
}

#[test]
fn every_job_runs_on_every_machine() {
    let jobs = || (1..=u8::MAX).filter(|job| *job != STORED && Job::new(*job).is_some());
    assert_eq!(jobs().count(), 13);
    let mut wrong = Vec::new();
    for (number, machine) in (0..).zip(ALL) {
        for job in jobs() {
            let ended = apart(|| run(number, job));
            if ended != lacks(machine.name, job).unwrap_or(END) {
                wrong.push(format!("{}, job {job}: {ended}", machine.name));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_machine_is_chosen_at_rest_only_and_kept() {
    apart(|| {
        let chip = boot();
        assert!(ask(&chip, "{mch:n}").contains("{\"mch\":0}"));
        let refused = ask(&chip, "{mch:5}");
        assert!(refused.contains("{\"mch\":5},\"f\":[1,110,"), "{refused}");
        ask(&chip, "g1 x1 f500");
        let refused = ask(&chip, "{mch:1}");
        assert!(refused.contains("{\"mch\":1},\"f\":[1,106,"), "{refused}");
        chip.run_ms(1_000);
        ask(&chip, "{si:200}");
        assert!(ask(&chip, "{mch:1}").contains("{\"mch\":1},\"f\":[1,0,"));
        let router = "{\"mch\":1,\"xvm\":5000,\"4ma\":1,\"ja\":1800000,\"si\":200,\"posx\":1.000}";
        let answer = ask(&chip, "{mch:n,xvm:n,4ma:n,ja:n,si:n,posx:n}");
        assert!(answer.contains(router), "{answer}");
        // 40 steps/mm, from where the motor is. Both motors of Y move.
        let before = chip.emitted().position;
        ask(&chip, "g0 x3 y1");
        chip.run_ms(1_000);
        let after = chip.emitted().position;
        assert_eq!([0, 1, 2, 3].map(|m| after[m] - before[m]), [80, 40, 0, 40]);
    });
}

#[test]
fn a_machine_survives_a_power_cut() {
    let asked = "{mch:n,xvm:n,yvm:n,aam:n,1mi:n}";
    let contents = apart(|| {
        let chip = boot();
        ask(&chip, "{mch:3,xvm:9000}");
        chip.run_ms(10_000);
        eeprom::contents()
    });
    let contents = apart(|| {
        eeprom::put(&contents);
        let chip = boot();
        let answer = ask(&chip, asked);
        let kept = "{\"mch\":3,\"xvm\":9000,\"yvm\":12000,\"aam\":1,\"1mi\":16}";
        assert!(answer.contains(kept), "{answer}");
        ask(&chip, "{defa:1}");
        chip.run_ms(10_000);
        eeprom::contents()
    });
    apart(|| {
        eeprom::put(&contents);
        let answer = ask(&boot(), asked);
        let defaults = "{\"mch\":0,\"xvm\":800,\"yvm\":800,\"aam\":1,\"1mi\":8}";
        assert!(answer.contains(defaults), "{answer}");
    });
}
