//! Tables of the interpreter that are stored in EEPROM alone, with the whole firmware on the host.

use std::thread;

use kerf::hal::imp::{Machine, eeprom};

use crate::kept_machine::{Sender, with, with_open};

impl Sender {
    /// Sends a line and waits until it is executed, however long that takes.
    fn carry_out(&mut self, line: &str) {
        let mut heard = self.ask(&format!("{line}\n"), 20);
        while !heard.contains("\"f\":") {
            heard += &self.ask("", 20);
        }
        assert!(heard.contains("\"f\":[1,0,"), "{line}: {heard}");
    }

    /// Returns the values of these tokens.
    fn values(&mut self, tokens: &[&str]) -> Vec<f64> {
        let asked: Vec<String> = tokens.iter().map(|token| format!("{token}:n")).collect();
        let answer = self.ask(&format!("{{{}}}\n", asked.join(",")), 50);
        let value = |token: &str| {
            let (_, rest) = answer.split_once(&format!("\"{token}\":"))?;
            rest.split([',', '}']).next()?.parse().ok()
        };
        tokens.iter().map(|token| value(token).unwrap_or_else(|| panic!("{answer}"))).collect()
    }

    /// Returns the origin of the coordinate system in force.
    fn origin(&mut self) -> Vec<f64> {
        self.values(&["ofsx", "ofsy", "ofsz", "ofsa", "ofsb", "ofsc"])
    }
}

/// G54 to G59.3.
fn system(number: usize) -> String {
    if number < 7 { format!("g{}", 53 + number) } else { format!("g59.{}", number - 6) }
}

#[test]
fn every_row_is_kept_however_fast_they_come() {
    let contents = with(Vec::new(), |sender| {
        // Each row is written twice, and the second time counts.
        let mut lines = String::new();
        for round in 1..=2 {
            for number in 1..=9 {
                lines += &format!("g10l2p{number}x{number}y{round}\n");
            }
            for tool in 1..=10 {
                lines += &format!("g10l1p{tool}z{tool}.{round}\n");
            }
            lines += &format!("g28.3x{round}\ng28.1\ng28.3x{}\ng30.1\n", round + 2);
        }
        let (mut heard, mut sent) = (String::new(), 0);
        for line in lines.split_inclusive('\n') {
            sent += 1;
            heard += &sender.ask(line, 1);
            // Four lines are in flight, as with most senders.
            while heard.matches("\"f\":").count() + 4 < sent {
                heard += &sender.ask("", 5);
            }
        }
        heard += &sender.ask("", 20_000);
        assert_eq!(heard.matches("\"f\":[1,0,").count(), 46, "{heard}");
        eeprom::contents()
    });
    with(contents, |sender| {
        for number in 1..=9 {
            sender.carry_out(&system(number));
            assert_eq!(sender.origin(), [number as f64, 2.0, 0.0, 0.0, 0.0, 0.0], "{number}");
        }
        for tool in 1..=10 {
            sender.carry_out(&format!("g43h{tool}"));
            assert_eq!(sender.values(&["tofz"]), [f64::from(tool) + 0.2]);
        }
        sender.carry_out("g28");
        sender.ask("", 1_000);
        assert_eq!(sender.values(&["mpox"]), [2.0]);
        sender.carry_out("g30");
        sender.ask("", 1_000);
        assert_eq!(sender.values(&["mpox"]), [4.0]);
    });
}

#[test]
fn another_row_waits_and_control_lines_do_not() {
    with(Vec::new(), |sender| {
        let heard = sender.ask("g10l2p1x1y2z3\ng10l2p2x1\n{fb:n}\n", 60);
        let (fb, lines) = (heard.find("\"fb\"").unwrap(), heard.matches("\"f\":").count());
        assert!(fb > heard.find("\"f\":").unwrap() && lines == 2, "{heard}");
        assert_eq!(sender.ask("", 300).matches("\"f\":[1,0,").count(), 1);
        // Writing the row that is being written already does not wait.
        let heard = sender.ask("g10l2p1x4\ng10l2p1y5\n", 10);
        assert_eq!(heard.matches("\"f\":[1,0,").count(), 2, "{heard}");
        assert_eq!(sender.origin()[..3], [4.0, 5.0, 3.0]);
        // Lines that read another row do not wait either.
        assert_eq!(sender.ask("g55\n", 10).matches("\"f\":[1,0,").count(), 1);
        // The line as part of a JSON request.
        let heard = sender.ask("{gc:\"g10l2p2x6\"}\n", 10);
        assert!(!heard.contains("\"f\":"), "{heard}");
        assert!(sender.ask("", 500).contains("\"f\":[1,0,"));
        assert_eq!(sender.origin()[0], 6.0);
    });
}

#[test]
fn a_power_cut_leaves_each_offset_old_or_new() {
    let old = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    let new = [1.5, 2.5, 3.5, 4.5, 5.5, 6.5];
    let cuts = with(Vec::new(), move |sender| {
        let words = |values: [f64; 6]| -> String {
            "xyzabc".chars().zip(values).map(|(letter, value)| format!("{letter}{value}")).collect()
        };
        sender.carry_out("{aam:1,bam:1,cam:1}");
        sender.carry_out(&format!("g10l2p2{}", words(old)));
        sender.carry_out(&format!("g10l2p3{}", words(old)));
        sender.ask("", 1_000);
        sender.0.send(format!("g10l2p2{}\n", words(new)).as_bytes());
        let mut cuts = Vec::new();
        for _ in 0..110 {
            sender.0.run_ms(3);
            cuts.push(eeprom::contents());
        }
        cuts
    });
    let mut arrived = 0;
    for cut in cuts {
        let (changed, other) = with(cut, |sender| {
            sender.carry_out("g55");
            let changed = sender.origin();
            sender.carry_out("g56");
            (changed, sender.origin())
        });
        assert_eq!(other, old);
        // Values are written one after the other, in the order of the axes.
        let now = changed.iter().zip(&new).take_while(|(is, new)| is == new).count();
        assert_eq!(changed[now..], old[now..]);
        assert!(now >= arrived, "{now} after {arrived}");
        arrived = now;
    }
    assert_eq!(arrived, 6);
}

#[test]
fn offsets_set_as_settings_survive_a_reset_and_wait_for_each_other() {
    let left = with(Vec::new(), |sender| {
        // Two rows in one line: the second waits for the first, and nothing is refused.
        let heard = sender.ask("{g54:{x:1,y:2},g55x:3}\n$g56z=4\n{fb:n}\n", 2_000);
        assert!(
            heard.contains("{\"r\":{\"g54\":{\"x\":1.000,\"y\":2.000},\"g55x\":3.000},\"f\":[1,0,")
        );
        assert!(heard.contains("[g56z] g56 z offset               4.000 mm\ntinyg [mm] ok> "));
        assert!(heard.contains("440.20"), "{heard}");
        eeprom::contents()
    });
    with(left, |sender| {
        assert_eq!(sender.origin()[..2], [1.0, 2.0]);
        let heard = sender.ask("{g55x:n,g56z:n}\n", 20);
        assert!(heard.contains("{\"g55x\":3.000,\"g56z\":4.000}"), "{heard}");
    });
}

#[test]
fn a_power_cut_leaves_each_cold_setting_old_or_new() {
    let cuts = with(Vec::new(), |sender| {
        sender.ask("{p1frq:200}\n{uda0:\"0x1\",uda1:\"0x1\"}\n", 2_000);
        sender.0.send(b"{p1frq:300}\n{uda0:\"0x2\"}\n");
        let mut cuts = Vec::new();
        for _ in 0..40 {
            sender.0.run_ms(3);
            cuts.push(eeprom::contents());
        }
        cuts
    });
    let mut seen = Vec::new();
    for cut in cuts {
        let heard = with(cut, |sender| sender.ask("{p1frq:n,uda0:n,uda1:n}\n", 20));
        let now = [(200, 1), (300, 1), (300, 2)].iter().position(|(frequency, data)| {
            let body = format!("{{\"p1frq\":{frequency},\"uda0\":\"0x{data}\",\"uda1\":\"0x1\"}}");
            heard.contains(&body)
        });
        seen.push(now.unwrap_or_else(|| panic!("{heard}")));
    }
    assert!(seen.is_sorted() && seen.contains(&1) && seen.last() == Some(&2), "{seen:?}");
}

#[test]
fn startup_lines_survive_a_power_cut_and_are_carried_out() {
    let left = with_open(Vec::new(), |sender| {
        let heard = sender.ask("$I\n$N0=g20 g55\n", 2_000);
        assert!(heard.ends_with("ok\r\nok\r\n"), "{heard}");
        eeprom::contents()
    });
    let start = move || {
        eeprom::put(&left);
        let mut sender = Sender(Machine::boot(115_200).expect("one machine for each thread"));
        (sender.ask("", 200), sender.ask("$G\n", 50))
    };
    let (greeting, modes) = thread::spawn(start).join().unwrap();
    assert!(greeting.contains("Grbl 1.1h") && greeting.contains(">G20G55:ok\r\n"), "{greeting}");
    assert!(modes.starts_with("[GC:G0 G55 G17 G20 "), "{modes}");
}
