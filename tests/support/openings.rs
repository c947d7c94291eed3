//! How senders that cannot run here open a conversation: the bytes that each sends, and the answers that it accepts,
//! by its own regular expressions and timeouts.
//!
//! Each opening is played on a port without a settled dialect and on one that is set to grbl's dialect, while the
//! other port is quiet and while it receives reports in TinyG's. A [`Step`] is over when lines have matched its
//! expressions in their order. Any other line must match an expression that every sender for grbl knows ([`KNOWN`]).
//! On a port without a settled dialect JSON may come until an answer shows that the dialect is settled.
//!
//! Bytes and expressions are facts from the senders' sources. Names in those sources are given with each sender.

use std::collections::VecDeque;
use std::thread;

use regex::Regex;

use crate::side::Side;

/// What is sent at once, what must be heard, and within how many ms.
struct Step {
    says: &'static [u8],
    hears: &'static [&'static str],
    within: u64,
}

/// A sender and its steps.
struct Sender {
    name: &'static str,
    steps: &'static [Step],
}

/// Makes a step.
const fn step(says: &'static [u8], hears: &'static [&'static str], within: u64) -> Step {
    Step { says, hears, within }
}

const OK: &str = "^ok$";
const GREETING: &str = r"^Grbl 1\.1[a-z]? \['\$' for help\]$";

/// Lines that every sender ignores or shows.
const KNOWN: [&str; 6] = [
    OK,
    GREETING,
    "^$",
    r"^<[A-Z][a-z]+(:\d)?\|.*>$",
    r"^\[(MSG|VER|OPT|GC|PRB|TLO|HLP):.*\]$",
    r"^\$\d+=-?[\d.]+$",
];

/// A status report: the state, then the position in machine coordinates, then more fields.
const REPORT: &str = r"^<(Idle|Run|Hold:[01]|Jog|Alarm|Door:[0-3]|Check|Home|Sleep)\|MPos:-?\d+\.\d{3},-?\d+\.\d{3},-?\d+\.\d{3}(,-?\d+\.\d{3})*\|";
const VERSION: &str = r"^\[VER:[v]?([0-9]*)\.([0-9]*)(\w?).*:.*\]$";
/// The options: letters, blocks, and bytes, which must be at least 128.
const OPTIONS: &str = r"^\[OPT:[A-Z0-9+*$#]*,\d+,(1[2-9]\d|[2-9]\d\d)\]$";
const MODES: &str = r"^\[(?:GC:)?((?:[a-zA-Z][0-9]+(?:\.[0-9]*)?\s*)+)\]$";
const ERROR: &str = r"^error:\d+$";
/// Settings that every sender looks for.
const SETTINGS: [&str; 8] = [
    r"^\$10=[0-3]$",
    r"^\$13=[01]$",
    r"^\$20=[01]$",
    r"^\$22=[01]$",
    r"^\$30=\d+(\.\d+)?$",
    r"^\$32=[01]$",
    r"^\$110=\d+\.\d{3}$",
    r"^\$130=\d+\.\d{3}$",
];

/// A status report of a machine with three axes: some senders read three numbers, and no more.
const THREE: &str = r"^<Idle\|MPos:-?[\d.]+,-?[\d.]+,-?[\d.]+\|";
const HELP: &str = r"^\[HLP:";

const SENDERS: [Sender; 16] = [
    // GrblControllerInitializer: a question until there is a status, an empty line, version and options, settings,
    // modes; then `?` 5 times a second. `isOkResponse` accepts `ok` alone. It gives up 12 s after the port was
    // opened, and 4 s after each line.
    Sender {
        name: "Universal G-Code Sender",
        steps: &[
            step(b"?", &[REPORT], 4_000),
            step(b"\n", &[OK], 4_000),
            step(b"$I\n", &[VERSION, OPTIONS, OK], 4_000),
            step(b"$$\n", &[SETTINGS[0], SETTINGS[6], SETTINGS[7], OK], 4_000),
            step(b"$G\n", &[MODES, OK], 4_000),
            step(b"?", &[REPORT], 200),
            step(b"?", &[REPORT], 200),
            // Its jog, the restoring of modes, and the way it zeroes an axis.
            step(b"$J=G21G91X20F600\n", &[OK], 1_000),
            step(b"?", &[r"^<(Run|Jog)\|"], 200),
            step(b"\x85", &[], 500),
            step(b"G10P0L20X0\n$G\n", &[OK, MODES, OK], 4_000),
            step(b"?", &[r"^<Idle\|"], 200),
        ],
    },
    // The version before the initializer: a reset, and nothing before the greeting, whose version follows its first
    // blank.
    Sender {
        name: "Universal G-Code Sender, older",
        steps: &[
            step(b"\x18", &["^Grbl [0-9]*\\.[0-9]*[a-z]"], 5_000),
            step(b"$I\n$G\n$$\n", &[VERSION, OPTIONS, OK, MODES, OK, SETTINGS[6], OK], 4_000),
            step(b"?", &[REPORT], 200),
        ],
    },
    // frmMain: `grblReset` sends 18 and accepts any line with the right beginning as the answer (`dataIsReset`). Then
    // come the lines that it shows, all at once, within 127 characters. States must be in its list. It asks every 250
    // ms, and each question waits for the report before it.
    Sender {
        name: "Candle",
        steps: &[
            step(b"\x18", &[r"(?i)^GRBL\s\d\.\d."], 5_000),
            step(b"?", &[r"^<(Idle|Alarm|Run|Home|Hold:0|Hold:1|Check|Door:[0-3]|Jog|Sleep)[|>].*MPos:([^,]*),([^,]*),([^,^>^|]*)"], 250),
            step(b"$$\n$#\n$G\n", &[SETTINGS[0], OK, r"^\[G54:", r"^\[G59:", r"^\[G28:", r"^\[G92:", r"^\[TLO:", r"^\[PRB:", OK, r"^\[GC:.*G5[4-9]", OK], 2_000),
            step(b"?", &[r"\|FS:([^,]*),([^,^|^>]*)"], 250),
            step(b"?", &[REPORT], 250),
            // Its jog, its zero, and a probing move that begins from its own program.
            step(b"$J=G21G91X1F300\n", &[OK], 1_000),
            step(b"\x85", &[], 500),
            step(b"G92X0Y0\n$#\n", &[OK, r"^\[G92:-?[\d.]+,-?[\d.]+,", OK], 2_000),
            step(b"G92.1\nG21G90\n", &[OK, OK], 1_000),
        ],
    },
    // It uses the GrblRunner of CNCjs: 18 half a second after the opening, then all lines that it shows at once; `?`
    // every 250 ms, and `$G` every 500 ms.
    Sender {
        name: "gSender",
        steps: &[
            step(b"\x18", &[r"^([a-zA-Z0-9]+)\s+((?:\d+\.){1,2}\d+[a-zA-Z0-9\-\.]*)([^\[]*\[[^\]]+\].*)?$"], 3_000),
            step(b"$I\n$$\n$#\n$G\n?", &[ r"^\[(?:VER:)(.+)\]$", r"^\[(?:OPT:)(.+)\]$", OK, r"^(\$[^=]+)=([^ ]*)\s*$", OK, r"^\[(G54|G55|G56|G57|G58|G59|G28|G30|G92|TLO|PRB):(.+)\]$", OK, MODES, OK], 5_000),
            step(b"?$G\n", &[REPORT, MODES, OK], 500),
            step(b"$J=G21G91 X1 F1000\n", &[OK], 1_000),
            step(b"\x85?", &[REPORT], 500),
            step(b"", &[], 500),
            step(b"G10 L20 P1 X0 Y0 Z0\n$#\n", &[OK, r"^\[G54:", OK], 2_000),
        ],
    },
    // GrblCore: 18, up to the greeting, whose numbers and letter it reads; then settings, then `?` every 200 ms. It
    // accepts `ok` in small letters only, and an error by its beginning. Its programs begin with these lines, and are
    // streamed within 127 characters.
    Sender {
        name: "LaserGRBL",
        steps: &[
            step(b"\x18", &[r"^Grbl (\d)\.(\d)([a-z])"], 5_000),
            step(b"$I\n", &[VERSION, OPTIONS, OK], 2_000),
            step(b"$$\n", &[SETTINGS[0], SETTINGS[1], SETTINGS[2], SETTINGS[3], SETTINGS[4], SETTINGS[5], SETTINGS[6], SETTINGS[7], OK], 2_000),
            step(b"?", &[REPORT], 300),
            step(b"G92 X0 Y0 Z0\nG90\nM5 S0\nG1 F1000\nM4\nG0 X0.1 Y0.1 S0\nG1 X0.2 F600 S100\nM5\n", &[OK, OK, OK, OK, OK, OK, OK, OK], 5_000),
            step(b"", &[], 1_000),
            step(b"$J=G91X1F1000\n", &[OK], 1_000),
            step(b"\x85", &[], 1_000),
            step(b"G92.1\n", &[OK], 1_000),
        ],
    },
    // Its back end: a line end, `$I` and 18 without an answer, then `$$`, `$I`, `$G` at once. The greeting begins a
    // line, and its version is the four characters behind the blank. `?` every 250 ms; the words of jogs have no
    // blanks between them.
    Sender {
        name: "OpenBuilds CONTROL",
        steps: &[
            step(b"\n\x18", &["^Grbl 1\\.1[a-z]"], 2_000),
            step(b"$$\n$I\n$G\n?", &[SETTINGS[6], OK, VERSION, OPTIONS, OK, MODES, OK], 5_000),
            step(b"?", &[REPORT], 250),
            step(b"$J=G91G21X1F100000\n$J=G91G21X-1F100000\n", &[OK, OK], 2_000),
            step(b"\x85", &[], 1_000),
            step(b"G54\nG21 G90\nM3 S100\nM5\n", &[OK, OK, OK, OK], 2_000),
        ],
    },
    // As its console shows: it waits for a greeting, asks for `$I` and `$$`, and takes the size of the buffer from
    // `OPT`. A job begins with these lines.
    Sender {
        name: "LightBurn",
        steps: &[
            step(b"", &[], 100),
            step(b"$I\n", &[VERSION, OPTIONS, OK], 2_000),
            step(b"$$\n", &[SETTINGS[0], SETTINGS[4], SETTINGS[5], SETTINGS[7], OK], 2_000),
            step(b"?", &[REPORT], 250),
            step(b"G00 G17 G40 G21 G54\nG90\nM4\nM8\nG0X0.1Y0.1S0\nG91\nG1X0.1S100F600\nM9\nG1S0\nM5\nG90\n", &[OK, OK, OK, OK, OK, OK, OK, OK, OK, OK, OK], 5_000),
            step(b"; a comment\nM2\n", &[OK, OK], 5_000),
            step(b"$#\n", &[r"^\[G54:", r"^\[PRB:", OK], 2_000),
            step(b"$J=G91X1F3000\n", &[OK], 1_000),
            step(b"\x85", &[], 1_000),
        ],
    },
    // Its driver for grbl asks for the help text, and reads `[HLP:` as the sign of life. It ends lines by CR.
    Sender {
        name: "MeerK40t",
        steps: &[
            step(b"$\r", &[HELP, OK], 2_000),
            step(b"$$\r", &[SETTINGS[0], SETTINGS[7], OK], 2_000),
            step(b"$I\r", &[VERSION, OPTIONS, OK], 2_000),
            step(b"G21\rG90\rM5 S0\rG0 X1 Y1\rG1 F600 X0 Y0\r", &[OK, OK, OK, OK, OK], 2_000),
            step(b"?", &[REPORT], 500),
        ],
    },
    // It asks up to ten times by a byte that grblHAL knows, and then by the usual one.
    Sender {
        name: "ioSender",
        steps: &[
            step(b"\x87", &[], 250),
            step(b"\x87\x87", &[], 250),
            step(b"\x87", &[], 250),
            step(b"?", &[REPORT], 1_500),
            step(b"$I\n", &[VERSION, r"^\[OPT:[A-Z0-9+]*Z", OK], 2_000),
            step(b"$$\n$#\n$G\n", &[SETTINGS[0], OK, r"^\[G54:", OK, MODES, OK], 2_000),
            step(b"\xA3?", &[REPORT], 500),
        ],
    },
    // The server's code: a blank line, a question, then the version; no reset unless the user wants one.
    Sender {
        name: "gSender 1.6",
        steps: &[
            step(b"\n", &[OK], 1_000),
            step(b"?", &[REPORT], 500),
            step(b"$I\n$$\n$#\n$G\n", &[VERSION, OPTIONS, OK, SETTINGS[0], OK, r"^\[G54:", OK, MODES, OK], 5_000),
        ],
    },
    // stream.py and simple_stream.py of grbl: two line ends, two seconds, all that was heard is dropped, then lines.
    // Each is counted, comments that were reduced to nothing as well.
    Sender {
        name: "stream.py",
        steps: &[
            step(b"\r\n\r\n", &[OK, OK], 2_000),
            step(b"G21\n\nG90 G1 F600 X1\n\nG1 X0\n", &[OK, OK, OK, OK, OK], 2_000),
            step(b"?", &[REPORT], 500),
        ],
    },
    Sender {
        name: "pygrbl-streamer",
        steps: &[
            step(b"\x18", &[GREETING], 2_000),
            step(b"$X\n", &[OK], 2_000),
            step(b"G21\n", &[OK], 2_000),
            step(b"G1 X1 F600\n", &[OK], 2_000),
        ],
    },
    // gcode-cli, gantrix, gscrib and grbl-link begin with one of these lines.
    Sender {
        name: "G-code at once",
        steps: &[
            step(b"G21 G90\n", &[OK], 1_000),
            step(b"$H\n", &["^ALARM:9$", ERROR], 60_000),
            step(b"$X\n", &[OK], 1_000),
            step(b"$100=250\n", &[OK], 1_000),
            step(b"?", &[REPORT], 500),
        ],
    },
    Sender {
        name: "plotdeck",
        steps: &[
            step(b"$I\n", &[VERSION, OK], 1_000),
            step(b"?", &[THREE], 500),
            step(b"$H\n?", &[], 500),
        ],
    },
    // What a user of TinyG types at a terminal.
    Sender {
        name: "a terminal",
        steps: &[
            step(b"h\n", &[r"^\[MSG:.*\{\}.*\]$", OK], 500),
            step(b"help\r\n", &[r"^\[MSG:.*\{\}.*\]$", OK], 500),
            step(b"?\n", &[REPORT, OK], 500),
        ],
    },
    // Cases that other senders may bring: everything in one write, with errors in it, in CR LF, and with lines that
    // are empty.
    Sender {
        name: "all at once",
        steps: &[
            step(b"\r\n\r\n\x18", &[GREETING], 5_000),
            step(b"$I\r\n$$\r\n$#\r\n$G\r\n$N\r\n$\r\n\r\n$foo\r\nG6\r\n", &[VERSION, OPTIONS, OK, SETTINGS[0], SETTINGS[7], OK, r"^\[G54:", r"^\[PRB:", OK, MODES, OK, r"^\$N0=", r"^\$N1=", OK, r"^\[HLP:", OK, OK, ERROR, ERROR], 5_000),
            step(b"???", &[REPORT], 100),
            step(b"?", &[r"^<Idle\|"], 100),
        ],
    },
];

/// A conversation.
struct Session<S> {
    side: S,
    heard: String,
    /// Whether the other port receives reports.
    aside: bool,
    /// Whether JSON may still come.
    json: bool,
    known: Vec<Regex>,
    /// How long bytes are on their way, in each direction, ms.
    latency: u64,
    now: u64,
    /// Bytes on their way to the machine, each with the time of their arrival.
    there: VecDeque<(u64, &'static [u8])>,
    /// Bytes on their way from the machine.
    back: VecDeque<(u64, Vec<u8>)>,
}

/// Takes what arrives first, if it has arrived.
fn due<T>(under_way: &mut VecDeque<(u64, T)>, now: u64) -> Option<(u64, T)> {
    under_way.front().is_some_and(|(at, _)| *at <= now).then(|| under_way.pop_front())?
}

impl<S: Side> Session<S> {
    fn run(&mut self) {
        while let Some((_, bytes)) = due(&mut self.there, self.now) {
            self.side.send(bytes);
        }
        self.side.run_ms(1);
        self.now += 1;
        self.back.push_back((self.now + self.latency, self.side.heard()));
        while let Some((_, bytes)) = due(&mut self.back, self.now) {
            self.heard += &String::from_utf8_lossy(&bytes);
        }
    }

    fn play(&mut self, step: &Step) -> Result<(), String> {
        self.there.push_back((self.now + self.latency, step.says));
        if self.aside {
            self.side.send_aux(b"{sr:n}\n");
        }
        let said = String::from_utf8_lossy(step.says).into_owned();
        let mut wanted =
            step.hears.iter().map(|text| Regex::new(text).expect("an expression")).peekable();
        for _ in 0..step.within + 2 * self.latency {
            self.run();
            while let Some((line, rest)) = self.heard.clone().split_once('\n') {
                self.heard = rest.to_string();
                let line = line.strip_suffix('\r').unwrap_or(line);
                if wanted.next_if(|one| one.is_match(line)).is_some() {
                    // `ok` and the greeting do not show that the dialect is settled.
                    self.json &= line == "ok" || line.starts_with("Grbl");
                } else if !self.passes_over(line) {
                    return Err(format!("{said:?} is answered by {line:?}"));
                }
            }
            if wanted.peek().is_none() && !step.hears.is_empty() {
                return Ok(());
            }
        }
        match wanted.next() {
            Some(missing) => {
                Err(format!("{said:?} has no answer like {missing} after {} ms", step.within))
            }
            None => Ok(()),
        }
    }

    fn passes_over(&self, line: &str) -> bool {
        let of_list = line.starts_with('[') || line.starts_with('$');
        of_list
            || (self.json && line.starts_with('{'))
            || self.known.iter().any(|one| one.is_match(line))
    }
}

/// A greeting, and who knows its machine by it: `G` is grbl's, `J` TinyG's, which is JSON.
struct Known {
    name: &'static str,
    /// Whether the sender works when it has heard these greetings, in this order.
    works: fn(&str) -> bool,
}

/// What senders do with greetings, by their sources: each that waits for one or decides by one. All others pass over
/// lines that they do not know.
const KNOWN_GREETINGS: [Known; 6] = [
    // A line with `Grbl`, and its version.
    Known {
        name: "UGS, Candle, gSender, LaserGRBL, OpenBuilds, pygrbl-streamer",
        works: |heard| heard.contains('G'),
    },
    // A response with SYSTEM READY before the first line is sent.
    Known { name: "g2core-api", works: |heard| heard.contains('J') },
    Known { name: "UGS for TinyG and g2core, after its reset", works: |heard| heard.contains('J') },
    // The last one of both decides. As a TinyG's sender it counts lines and never asks.
    Known { name: "lw.comm-server", works: |heard| heard.ends_with('G') },
    // They need none.
    Known { name: "CNCjs for TinyG", works: |_| true },
    Known { name: "gcode-cli, gantrix, gscrib, grbl-link, stream.py", works: |_| true },
];

/// Of all greetings only this one loses no sender, and it is the one that a machine sends.
pub fn greeting(mut side: impl Side) {
    let losers = |heard: &str| {
        let lost = KNOWN_GREETINGS.iter().filter(|known| !(known.works)(heard));
        lost.map(|known| known.name).collect::<Vec<_>>()
    };
    for other in ["", "G", "J", "GJ"] {
        assert!(!losers(other).is_empty(), "{other} would do");
    }
    assert_eq!(losers("JG"), [""; 0]);
    (0..200).for_each(|_| side.run_ms(1));
    let heard = String::from_utf8_lossy(&side.heard()).into_owned();
    let lines: Vec<&str> = heard.lines().filter(|line| !line.is_empty()).collect();
    let [json, grbl] = lines[..] else { panic!("{heard}") };
    assert!(json.starts_with("{\"r\":{\"fv\"") && json.contains("SYSTEM READY"), "{heard}");
    assert!(Regex::new(GREETING).expect("an expression").is_match(grbl), "{heard}");
}

/// What is sent, what is heard, and how many responses in JSON.
type Said = (&'static [u8], &'static str, usize);

/// How senders of TinyG's dialect begin.
const OF_TINYG: [(&str, &[Said]); 6] = [
    (
        "CNCjs",
        &[
            (b"{ej:1}\n{jv:4}\n{qv:1}\n{sv:1}\n{si:200}\n", "", 5),
            (b"{spe:n}\n", "", 1),
            (b"N1G21\n", "", 1),
        ],
    ),
    // An enquiry, whose answer it waits for.
    (
        "UGS for g2core",
        &[(b"\x05", "{\"ack\":true}", 0), (b"{\"ee\":0}\n", "", 1), (b"G21\n", "", 1)],
    ),
    (
        "UGS for TinyG",
        &[(b"\x18", "SYSTEM READY", 1), (b"{\"ee\":0}\n{\"jv\":4}\n", "", 2), (b"G21\n", "", 1)],
    ),
    // Empty lines, which are answered in grbl's dialect: it passes over that.
    (
        "bCNC for g2core",
        &[(b"\n\n", "ok\r\nok\r\n", 0), (b"{sr:{stat:t,line:t}}\n", "", 1), (b"G21\n", "", 1)],
    ),
    ("G-code first", &[(b"G21\n", "ok\r\n", 0), (b"{sr:n}\n", "", 1), (b"G21\n", "", 1)]),
    ("a terminal", &[(b"$xvm\r\n", "[xvm]", 0), (b"?\r\n", "Velocity", 0)]),
];

/// Plays the openings of TinyG's senders on an open port.
pub fn of_tinyg<S: Side>(boot: impl Fn() -> S + Sync) {
    let failed = OF_TINYG.iter().filter(|(name, steps)| {
        let play = || play_tinyg(boot(), name, steps);
        thread::scope(|scope| scope.spawn(play).join()).is_err()
    });
    assert_eq!(failed.count(), 0);
}

fn play_tinyg(mut side: impl Side, name: &str, steps: &[Said]) {
    (0..200).for_each(|_| side.run_ms(1));
    side.heard();
    for (says, hears, responses) in steps {
        side.send(says);
        (0..500).for_each(|_| side.run_ms(1));
        let heard = String::from_utf8_lossy(&side.heard()).into_owned();
        let said = String::from_utf8_lossy(says);
        assert!(heard.contains(hears), "{name}: {said:?} {heard}");
        assert_eq!(heard.matches("{\"r\":{").count(), *responses, "{name}: {said:?} {heard}");
    }
}

/// Bytes that act by themselves, a hold, a reset, a kill, the door; and those that begin a command: `$H` homes, and a
/// question in braces is text.
const ACT: [u8; 6] = [b'!', 0x18, 0x04, 0x84, b'$', b'{'];

/// Sends some bytes of noise, as a port that was opened at another rate hears them, and a question in the midst of
/// them. It is answered, and so are the lines behind the line of noise.
pub fn noise<S: Side>(boot: impl Fn() -> S, seeds: std::ops::Range<u64>) {
    for seed in seeds {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_041);
            (state >> 33) % below
        };
        let noise: Vec<u8> = (0..=random(29))
            .map(|_| random(256) as u8)
            .filter(|byte| !ACT.contains(byte))
            .collect();
        let mut side = boot();
        let mut ask = |bytes: &[u8], ms: u64| {
            side.send(bytes);
            (0..ms).for_each(|_| side.run_ms(1));
            String::from_utf8_lossy(&side.heard()).into_owned()
        };
        ask(b"", 100);
        let early = ask(&noise, 50);
        let heard = ask(b"?", 100);
        assert!(heard.contains("<Idle|"), "seed {seed}: {noise:02X?} ? {heard}");
        // A return in the noise has ended the line already.
        let heard = early + &heard + &ask(b"\n", 100);
        assert!(
            heard.contains("ok\r\n") || heard.contains("error:"),
            "seed {seed}: {noise:02X?} {heard}"
        );
        let heard = ask(b"$$\n", 200);
        assert!(
            heard.starts_with("$0=") && heard.ends_with("ok\r\n"),
            "seed {seed}: {noise:02X?} {heard}"
        );
        let heard = ask(b"G21\n", 100);
        assert_eq!(heard, "ok\r\n", "seed {seed}: {noise:02X?}");
    }
}

/// Plays all senders, each with machines that `boot` starts with this value of `dia`.
pub fn all<S: Side>(boot: impl Fn(u8) -> S + Sync) {
    play_all(&[(0, false), (0, true), (3, false), (11, true)], 0, |dia, _| boot(dia));
}

/// Plays all senders on a line that delays each byte by so many ms. `boot` is given what the sender says first.
pub fn all_late<S: Side>(latency: u64, boot: impl Fn(&'static [u8]) -> S + Sync) {
    play_all(&[(0, false)], latency, |_, first| boot(first));
}

fn play_all<S: Side>(
    cases: &[(u8, bool)],
    latency: u64,
    boot: impl Fn(u8, &'static [u8]) -> S + Sync,
) {
    let known = || KNOWN.iter().map(|text| Regex::new(text).expect("an expression")).collect();
    let mut failed = Vec::new();
    for (dia, aside) in cases.iter().copied() {
        for sender in &SENDERS {
            let play = || {
                let side = boot(dia, sender.steps[0].says);
                let mut session = Session {
                    side,
                    heard: String::new(),
                    aside,
                    json: dia == 0,
                    known: known(),
                    latency,
                    now: 0,
                    there: VecDeque::new(),
                    back: VecDeque::new(),
                };
                if aside {
                    session.side.send_aux(b"{sr:{posx:t,posy:t,posz:t,vel:t,feed:t,stat:t,line:t,unit:t,coor:t,dist:t}}\n{sv:2}\n{si:100}\n");
                    (0..400).for_each(|_| session.run());
                }
                sender.steps.iter().try_for_each(|step| session.play(step))
            };
            let played = thread::scope(|scope| scope.spawn(play).join());
            match played {
                Ok(Ok(())) => {}
                Ok(Err(why)) => {
                    failed.push(format!("{}, dia {dia}, aside {aside}: {why}", sender.name))
                }
                Err(_) => failed.push(format!("{} panics", sender.name)),
            }
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}
