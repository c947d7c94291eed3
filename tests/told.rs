//! Reports tell what the machine does, not what it has read: random programs on the host (`tests/support/told.rs`).

use kerf::hal::imp::{self, Machine};

use crate::apart::apart;
use crate::seeds::try_all;
use crate::told_session::{Told, Tongue};

fn play(tongue: Tongue, seed: u64) -> Result<(), String> {
    // Half of the machines blend.
    imp::set_blends(seed % 4 >= 2);
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    let mut told = Told::new(machine, tongue, seed);
    // Only in this dialect the lines that a flush drops are known.
    let stops = tongue == Tongue::TinyG && seed % 2 == 1;
    for part in 0..3 {
        told.run(15, stops && part < 2).map_err(|why| format!("{why}\n{}", told.story()))?;
    }
    if told.compared < 50 {
        return Err(format!("only {} reports", told.compared));
    }
    Ok(())
}

fn reports_tell_what_runs(tongue: Tongue) {
    try_all(20, |seed| apart(move || play(tongue, seed)));
}

#[test]
fn of_tinyg_tell_what_runs() {
    reports_tell_what_runs(Tongue::TinyG);
}

#[test]
fn of_grbl_tell_what_runs() {
    reports_tell_what_runs(Tongue::Grbl);
}

#[test]
fn of_printing_hosts_tell_what_runs() {
    reports_tell_what_runs(Tongue::RepRap);
}

/// Streams moves along a zigzag in X and Y with a line behind each of them. Returns where X was in each ms.
fn path_of(behind: [&str; 2]) -> Vec<i64> {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    machine.run_ms(100);
    machine.send(b"{x:{vm:6000,fr:6000,jm:2000,ac:0},y:{vm:6000,fr:6000,jm:2000,ac:0}}\n");
    machine.run_ms(50);
    machine.received();
    let mut lines = vec!["g21g90g1f3000x0y0".to_string(), String::from(behind[1])];
    for n in 1..=200 {
        lines.push(format!("x{:.2}y{:.2}", f64::from(n) * 0.6, f64::from(n % 3) * 0.1));
        lines.push(behind[n as usize % 2].to_string());
    }
    let (mut sent, mut answered, mut rests) = (0, 0, 0);
    let mut heard = String::new();
    let mut path = vec![0];
    while rests < 100 {
        while sent < lines.len() && sent < answered + 4 {
            machine.send(format!("{}\n", lines[sent]).as_bytes());
            sent += 1;
        }
        machine.run_ms(1);
        heard += &String::from_utf8(machine.received()).unwrap();
        answered = heard.matches("\"f\":[1,0,").count();
        let at = machine.emitted().position[0];
        rests = if path.last() == Some(&at) && at > 0 { rests + 1 } else { 0 };
        path.push(at);
    }
    assert_eq!((answered, path.last()), (lines.len(), Some(&(200 * 768))));
    path
}

/// The tool length changes behind each move, and nothing else differs: no move stops for it, nor is it slower.
#[test]
fn a_change_of_the_offset_stops_nothing() {
    let usual = apart(|| path_of(["m50", "m50"]));
    let with = apart(|| path_of(["g43.1z1", "g43.1z2"]));
    let still = |path: &[i64]| path.windows(6).filter(|ms| ms[0] == ms[5]).count();
    // Only before and behind the moves.
    assert!(still(&with) <= still(&usual) + 20, "{} and {}", still(&with), still(&usual));
    let (fast, slow) = (usual.len() as f64, with.len() as f64);
    assert!(slow <= fast * 1.01 + 20.0, "{slow} ms, and {fast} without");
}
