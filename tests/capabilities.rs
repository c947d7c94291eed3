//! A code whose capability the image lacks is refused by the name of the capability; all others are executed. The
//! tests run with and without capabilities: `cargo test --test capabilities --no-default-features --features
//! std,dialect-tinyg` builds the machine without any.

use kerf::capability::Capability;
use kerf::gcode::Interpreter;
use kerf::gcode::codes::Action;
use kerf::gcode::codes::table::G;
use kerf::gcode::command::Commands;
use kerf::gcode::setup::Usual;
use kerf::hal::imp::Machine;
use kerf::protocol::tinyg::number;
use kerf::status::Status;

/// Returns a line for each code that needs a capability.
fn lines() -> Vec<(Capability, String)> {
    let rows = G.get();
    let modes = rows.iter().filter_map(|row| match row.action {
        Action::Motion(mode) => Some((mode.capability()?, row.number)),
        Action::SpeedMode(_) | Action::XMode(_) => Some((Capability::Lathe, row.number)),
        _ => None,
    });
    let line = |number: u16| {
        let code = format!("G{}.{}", number / 10, number % 10);
        format!("M3 S1000 {code} X10 Y10 Z-5 R1 Q1 P1 I1 J0 K-1 F100")
    };
    let own = |capability, number| match capability {
        Capability::Probing => format!("G{}.{} X10 F100", number / 10, number % 10),
        Capability::Lathe if matches!(number, 70 | 80 | 960 | 970) => {
            format!("G{} S100", number / 10)
        }
        Capability::Lathe => format!("M3 G{}.{} Z-5 K1", number / 10, number % 10),
        _ => line(number),
    };
    modes.map(|(capability, number)| (capability, own(capability, number))).collect()
}

/// Returns a new interpreter's answer to a line, from which words that its code does not take have been removed.
fn said_of(line: &str) -> Result<(), Status> {
    let mut line = String::from(line);
    loop {
        let (mut interpreter, mut out) = (Interpreter::new(), Commands::default());
        match interpreter.interpret(line.as_bytes(), &Usual, &mut out) {
            Err(Status::WordUnused) => {
                let at = ["Q1 ", "P1 ", "I1 J0 K-1 "].into_iter().find(|word| line.contains(word));
                line = line.replace(at.expect("a word that may go"), "");
            }
            done => return done.map(drop),
        }
    }
}

#[test]
fn codes_are_refused_by_name_where_their_capability_is_not_built_in() {
    let lines = lines();
    assert_eq!(
        lines.len(),
        10 + 4 + 8,
        "G73, G81 to G89, G38.2 to G38.5, G32, G33, G33.1, G76, G7, G8, G96, G97"
    );
    for (capability, line) in lines {
        let refused = said_of(&line) == Err(Status::NotBuiltIn);
        assert_eq!(refused, !capability.is_built_in(), "{line}: {:?}", said_of(&line));
    }
}

#[test]
fn other_codes_need_none() {
    for line in ["G0 X1", "G1 X1 F100", "G2 I1 F100", "G80", "G98", "G28.2 X0", "G4 P1"] {
        assert_eq!(said_of(line), Ok(()), "{line}");
    }
}

#[test]
fn the_machine_says_that_it_lacks_something() {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    let ask = |line: &str| {
        machine.send(line.as_bytes());
        machine.send(b"\n");
        machine.run_ms(300);
        String::from_utf8(machine.received()).expect("ASCII")
    };
    // TinyG's dialect from now on.
    assert!(ask("{}").contains("\"f\":[1,0,"));
    let lacks = format!("\"f\":[1,{},", number(Status::NotBuiltIn));
    assert!(!Capability::Help.is_built_in() || Capability::Text.is_built_in());
    for (capability, line) in [
        (Capability::Cycles, "g81x1z-1r1f100"),
        (Capability::Boring, "m3s100g86x1z-1r1p1f100"),
        (Capability::Probing, "g38.3x1f100"),
        (Capability::Lathe, "g33z-1k1"),
        (Capability::Lathe, "{spn:1}"),
        (Capability::Printer, "m104s0"),
        (Capability::Printer, "m107"),
        (Capability::CoreXy, "{1ma:6}"),
        (Capability::Backlash, "{xbl:0.1}"),
        (Capability::Help, "{h:n}"),
        (Capability::Jobs, "{test:3}"),
    ] {
        let answer = ask(line);
        assert_eq!(answer.contains(&lacks), !capability.is_built_in(), "{line}: {answer}");
        assert!(answer.contains("\"f\":["), "{line}: {answer}");
    }
    ask("{test:0}");
    for (capability, line) in [
        (Capability::Help, "h"),
        (Capability::Help, "$h"),
        (Capability::Help, "$defa"),
        (Capability::Jobs, "$test"),
    ] {
        let answer = ask(line);
        // In an image without text mode the answer is JSON.
        let refused =
            answer.contains("err: Not built into this image: ") || answer.contains(&lacks);
        let is_built_in = capability.is_built_in() && Capability::Help.is_built_in();
        assert_eq!(refused, !is_built_in, "{line}: {answer}");
    }
    for line in ["$xvm", "?", "$ej=0", "{ej:0}"] {
        let answer = ask(line);
        assert_eq!(answer.contains(&lacks), !Capability::Text.is_built_in(), "{line}: {answer}");
    }
}
