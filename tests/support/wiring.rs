//! `docs/wiring.md` and its drawings, from the boards' files.

use kerf::boards::{ALL, Board, Pin, Port, gp, inputs};

const PREFACE: &str = "\
# Wiring

<!-- Made from `boards/*.rs` by `cargo xtask docs`: change it there. -->

The pins of each board. Check them against your shield **before** you connect a spindle or a heater.

- **A CNC Shield V3 for the Arduino Uno does not fit.** It plugs into a Mega, but its pins differ: motors would not move, and outputs would switch
  at random. `mega2560-grbl` means the pins of grbl for the *Mega*: steps on D24 to D27.
- **Switches** go between the input and ground. You need no resistor. Set normally open or closed by `st` for the axes, `saf` for the door, `est` for the
  emergency stop. The probe is normally open.
- **Outputs are 5 V logic** (3.3 V on an RP2040), a few milliamperes. Relays, coils and spindles need a driver. An inverter with an input of 0 to 10 V
  needs a converter from PWM to 0 to 10 V, and a common ground. During a reset the pins float: fit pull-down resistors, 10 kOhm, where
  something must stay off.
- **The emergency stop input is additional.** The emergency stop itself must cut the power of motors and spindle.
- Long switch wires pick up noise. Shield them, keep them away from spindle cables, and prefer normally closed switches.

";

/// Returns the name of a pin on an Arduino Mega 2560. Pins from D38 on are in the double row.
fn arduino(pin: Pin) -> String {
    let digital: &[(Port, [u8; 8])] = &[
        (Port::A, [22, 23, 24, 25, 26, 27, 28, 29]),
        (Port::B, [53, 52, 51, 50, 10, 11, 12, 13]),
        (Port::C, [37, 36, 35, 34, 33, 32, 31, 30]),
        (Port::D, [21, 20, 19, 18, 0, 0, 0, 38]),
        (Port::E, [0, 1, 0, 5, 2, 3, 0, 0]),
        (Port::G, [41, 40, 39, 0, 0, 4, 0, 0]),
        (Port::H, [17, 16, 0, 6, 7, 8, 9, 0]),
        (Port::J, [15, 14, 0, 0, 0, 0, 0, 0]),
        (Port::L, [49, 48, 47, 46, 45, 44, 43, 42]),
    ];
    match pin.port {
        Port::F => format!("A{}", pin.bit),
        Port::K => format!("A{}", 8 + pin.bit),
        port => {
            let row = digital.iter().find(|(of, _)| *of == port).expect("a port of the Mega");
            format!("D{}", row.1[usize::from(pin.bit)])
        }
    }
}

/// The headers of RAMPS 1.4, by the Arduino's name of the pin. The grbl shield is not listed, because there are many
/// kinds of it.
const RAMPS: [(&str, &str); 26] = [
    ("A0", "X driver"),
    ("A1", "X driver"),
    ("D38", "X driver"),
    ("A6", "Y driver"),
    ("A7", "Y driver"),
    ("A2", "Y driver"),
    ("D46", "Z driver"),
    ("D48", "Z driver"),
    ("A8", "Z driver"),
    ("D26", "E0 driver"),
    ("D28", "E0 driver"),
    ("D24", "E0 driver"),
    ("D3", "endstops, X min"),
    ("D2", "endstops, X max"),
    ("D14", "endstops, Y min"),
    ("D15", "endstops, Y max"),
    ("D18", "endstops, Z min"),
    ("D19", "endstops, Z max"),
    ("D4", "servos"),
    ("D5", "servos"),
    ("D6", "servos"),
    ("D11", "servos"),
    ("A3", "AUX-1"),
    ("A10", "AUX-2"),
    ("A12", "AUX-2"),
    ("A9", "AUX-2"),
];

/// A row: what is connected, the pin, the level that is on, and the setting.
struct Wire {
    what: String,
    pin: Pin,
    level: &'static str,
    setting: String,
}

fn wires(board: &Board) -> Vec<Wire> {
    let mut wires = Vec::new();
    let mut add = |what: String, pin: Option<Pin>, level, setting: String| {
        wires.extend(pin.map(|pin| Wire { what, pin, level, setting }));
    };
    for (n, pins) in (1..).zip(board.motors) {
        let motor = match ["X", "Y", "Z", "A"].get(n - 1) {
            Some(axis) => format!("motor {n} ({axis})"),
            None => format!("motor {n}"),
        };
        add(format!("{motor}, step"), Some(pins.step), "rising edge", format!("`{n}sp`"));
        add(format!("{motor}, direction"), Some(pins.dir), "low is +", format!("`{n}po`"));
        add(format!("{motor}, enable"), pins.enable, "low is on", format!("`{n}pm`"));
    }
    let powers = format!("`1pm` to `{}pm`", board.motors.len());
    add("all motors, enable".into(), board.enable_all, "low is on", powers);
    let outputs = [
        ("spindle, on", "high is on", "`spep`"),
        ("spindle, direction", "high is counter-clockwise", "`spdp`"),
        ("mist", "high is on", "M7"),
        ("flood", "high is on", "M8"),
    ];
    for ((what, level, setting), pin) in outputs.into_iter().zip(board.outputs) {
        add(what.into(), pin, level, setting.into());
    }
    add("spindle, speed (PWM)".into(), board.pwm.map(|pwm| pwm.pin()), "pulses", "`p1`".into());
    let mut end = 0;
    while end < inputs::ENDS {
        let axis = ["X", "Y", "Z", "A"][end / 2];
        let letter = axis.to_lowercase();
        let (lower, upper) = (board.inputs[end], board.inputs[end + 1]);
        if lower.is_some() && lower == upper {
            let setting = format!("`{letter}sn`, `{letter}sx`");
            add(format!("{axis} switches, both ends"), lower, "to ground", setting);
        } else {
            add(format!("{axis} switch, lower end"), lower, "to ground", format!("`{letter}sn`"));
            add(format!("{axis} switch, upper end"), upper, "to ground", format!("`{letter}sx`"));
        }
        end += 2;
    }
    add("probe".into(), board.inputs[inputs::PROBE], "to ground", "G38.2".into());
    add("door".into(), board.inputs[inputs::DOOR], "to ground", "`saf`".into());
    add("emergency stop".into(), board.inputs[inputs::STOP], "to ground", "`est`".into());
    if let Some(encoder) = board.encoder.filter(|_| is_numbered(board)) {
        add("spindle sensor, index".into(), Some(encoder.index), "to ground", "`spn`".into());
        add("spindle sensor, sync".into(), Some(encoder.sync), "to ground", "`spn`".into());
    }
    if let Some(heaters) = board.heaters.filter(|_| is_numbered(board)) {
        let named = ["hot end", "bed"].into_iter().zip(["`he1`", "`he3`"]).zip(heaters.heaters);
        for ((name, setting), heater) in named {
            add(format!("{name}, heater"), Some(heater.pin), "high is on", setting.into());
            let sensor = Some(gp(26 + heater.channel));
            add(format!("{name}, sensor"), sensor, "thermistor to ground", setting.into());
        }
        add("fan".into(), Some(heaters.fan), "high is on", "M106".into());
        add("fan of the heatbreak".into(), heaters.cooler, "high is on", "by itself".into());
    }
    // The first port of an Arduino is its USB. The first port of a chip with USB of its own has no pins.
    let wired = usize::from(!is_numbered(board));
    for (port, name) in board.serial.iter().zip(["first port", "second port"]).skip(wired) {
        let Some([rx, tx]) = port.line() else { continue };
        add(format!("{name}, receives"), Some(rx), "serial", "115,200 baud".into());
        add(format!("{name}, sends"), Some(tx), "serial", "115,200 baud".into());
        if let Some(handshake) = port.handshake {
            add(format!("{name}, RTS"), Some(handshake.rts), "high is stop", "`ex` 2".into());
            add(format!("{name}, CTS"), Some(handshake.cts), "high is stop", "`ex` 2".into());
        }
    }
    wires
}

fn about(board: &Board) -> &'static str {
    match board.name {
        "mega2560-grbl" => {
            "An Arduino Mega 2560 with a shield, or single wires, for the pins of grbl for the Mega. The default board. `mega2560-lathe` and \
             `mega2560-grbl-lathe` have the same pins, and a [spindle's sensors](lathe.md)."
        }
        "ramps14" => {
            "An Arduino Mega 2560 with RAMPS 1.4: X, Y, Z and the first extruder (E0) as A. `ramps14-cnc` has the same pins, without heaters."
        }
        "pico" => {
            "A Raspberry Pi Pico on a breakout board, with four drivers. **Its pins are 3.3 V** and tolerate no more: see [the RP2040](rp2040.md)."
        }
        "pico6" => {
            "A Raspberry Pi Pico with six drivers: the two additional motors may share an axis with another motor, or move B and C. **3.3 V**, as `pico`."
        }
        "picobob" => {
            "An Expatria PicoBOB on a Mach3 breakout board with five drivers. X and Z share a switch input, so each must leave its switch behind homing (`xzb`, `zzb`). \
             The relay of the spindle is the output of the fifth motor's direction: the spindle has only its speed, 0 to 10 V. The pins are those of the chip, which are **3.3 V**; the PicoBOB shifts levels."
        }
        "picocnc" => {
            "A PicoCNC of Phil Barrett. Its terminals have the names of what they do. Steps, directions, enables and outputs are behind shift registers at 5 V; inputs have opto-couplers. \
             **Until Kerf has started, and while RESET or BOOTSEL is pressed, the registers hold what they held before**, and anything at power-up: see [what to watch](rp2040.md#watch-at-the-first-power-up)."
        }
        "picohal" => {
            "An Expatria PicoHAL under a CNC shield with four drivers. Z and A share a switch input. The probe is the shield's A5, the emergency stop its Hold, the spindle's sensors are A4 and Run. **3.3 V**, as `pico`."
        }
        "skr-pico" => {
            "A BTT SKR Pico v1.0: motor 4 is its driver E. FAN1 cools the print, FAN2 the heatbreak of the hot end; FAN3 is the spindle's enable, the servo pin is the spindle's PWM. **3.3 V**, as `pico`. \
             A DIAG jumper connects the driver's pin instead of the switch of X, Y or Z, for [homing by a stall](rp2040.md#homing-by-a-stall): remove the switch then. \
             Leave the jumper of E off: its pin is the emergency stop's."
        }
        _ => "",
    }
}

fn header(board: &Board, pin: &str) -> &'static str {
    let rows = if board.name == "ramps14" { &RAMPS[..] } else { &[] };
    rows.iter().find(|(name, _)| *name == pin).map_or("", |(_, header)| header)
}

/// Whether a board has the RP2040, whose pins are numbered.
fn is_numbered(board: &Board) -> bool {
    board.motors[0].step.port.is_of_rp2040()
}

/// Returns the Arduino boards with different pins: the ones that are drawn.
pub fn drawn() -> impl Iterator<Item = &'static Board> {
    let pins = |board: &Board| wires(board).iter().map(|wire| wire.pin).collect::<Vec<_>>();
    let is_first = move |n: usize| !ALL[..n].iter().any(|other| pins(other) == pins(ALL[n]));
    let boards = ALL.into_iter().enumerate().filter(|(_, board)| !is_numbered(board));
    boards.filter(move |(n, _)| is_first(*n)).map(|(_, board)| board)
}

/// Returns the whole page.
pub fn markdown() -> String {
    let mut text = PREFACE.to_string();
    for board in drawn() {
        let name = board.name;
        text +=
            &format!("## {name}\n\n{}\n\n![Pins of {name}](wiring-{name}.svg)\n\n", about(board));
        let is_ramps = name == "ramps14";
        text += "| what | Arduino pin |";
        text += if is_ramps { " header |" } else { "" };
        text += " chip | level | setting |\n|---|---|---|---|---|";
        text += if is_ramps { "---|\n" } else { "\n" };
        for wire in wires(board) {
            let pin = arduino(wire.pin);
            let header =
                if is_ramps { format!(" {} |", header(board, &pin)) } else { String::new() };
            let chip = format!("P{}{}", wire.pin.port.letter(), wire.pin.bit);
            text += &format!(
                "| {} | {pin} |{header} {chip} | {} | {} |\n",
                wire.what, wire.level, wire.setting
            );
        }
        text += "\n";
        if is_ramps {
            text += "D10, D8 and D9 are hot end, bed and fan ([printing.md](printing.md#wiring-ramps)); they are off (low) until a line switches them on, and after every fault. Kerf uses D16 internally: leave it open.\n\n";
        } else {
            text += "Kerf uses D16 internally: leave it open.\n\n";
        }
    }
    text += &ALL.into_iter().filter(|board| is_numbered(board)).map(numbered).collect::<String>();
    text.trim_end().to_string() + "\n"
}

/// Returns the section of a board with numbered pins.
fn numbered(board: &Board) -> String {
    let mut text = format!("## {}\n\n{}\n\n", board.name, about(board));
    text += "| what | pin | level | setting |\n|---|---|---|---|\n";
    for Wire { what, pin, level, setting } in wires(board) {
        text += &format!("| {what} | {} | {level} | {setting} |\n", named(pin));
    }
    text + "\n"
}

/// Returns the name of a pin of the chip, or of an output of a shift register.
fn named(pin: Pin) -> String {
    match pin.port {
        Port::Steps => format!("step register, output {}", pin.bit),
        Port::Outputs => format!("output register, output {}", pin.bit),
        _ => format!("GP{}", pin.bit),
    }
}

/// Returns the headers of a Mega, as they lie with USB to the left: the place of the first pin, and the pins from
/// left to right.
fn headers() -> Vec<(f64, f64, Vec<String>)> {
    let digital = |numbers: &[u8]| numbers.iter().map(|n| format!("D{n}")).collect::<Vec<_>>();
    let analog = |from: u8| (from..from + 8).map(|n| format!("A{n}")).collect::<Vec<_>>();
    let pairs = |first: u8| (0..16).map(|n| format!("D{}", first + 2 * n)).collect::<Vec<_>>();
    vec![
        (230.0, 0.0, digital(&[13, 12, 11, 10, 9, 8])),
        (390.0, 0.0, digital(&[7, 6, 5, 4, 3, 2, 1, 0])),
        (600.0, 0.0, digital(&[14, 15, 16, 17, 18, 19, 20, 21])),
        (390.0, 1.0, analog(0)),
        (600.0, 1.0, analog(8)),
        (820.0, 2.0, pairs(22)),
        (820.0, 3.0, pairs(23)),
    ]
}

/// Returns a drawing of the board with the connections of its pins.
pub fn svg(board: &Board) -> String {
    const PITCH: f64 = 24.0;
    let wires = wires(board);
    let user = |pin: &str| wires.iter().find(|wire| arduino(wire.pin) == pin);
    let mut text = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 1160 800\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"1160\" height=\"800\" fill=\"#fff\"/>\n\
         <rect x=\"150\" y=\"190\" width=\"740\" height=\"420\" rx=\"10\" fill=\"#e8f1f5\" stroke=\"#356\" stroke-width=\"2\"/>\n\
         <rect x=\"130\" y=\"250\" width=\"70\" height=\"80\" fill=\"#ccc\" stroke=\"#666\"/><text x=\"148\" y=\"295\">USB</text>\n\
         <rect x=\"130\" y=\"500\" width=\"70\" height=\"60\" fill=\"#444\" stroke=\"#222\"/><text x=\"142\" y=\"535\" fill=\"#fff\">power</text>\n",
    );
    text += &format!(
        "<text x=\"320\" y=\"390\" font-size=\"22\">{}</text>\n<text x=\"320\" y=\"420\">Arduino Mega 2560, seen from above</text>\n",
        board.name
    );
    for (x, row, pins) in headers() {
        for (n, pin) in pins.iter().enumerate() {
            let along = n as f64 * PITCH;
            // Double rows run down at the right edge; the other headers lie along the upper and the lower edge.
            let (px, py) = match row as u8 {
                0 => (x + along, 205.0),
                1 => (x + along, 595.0),
                2 => (850.0, 205.0 + along),
                _ => (874.0, 205.0 + along),
            };
            let wire = user(pin);
            let fill = if wire.is_some() { "#d62" } else { "#999" };
            text += &format!("<circle cx=\"{px}\" cy=\"{py}\" r=\"4\" fill=\"{fill}\"/>\n");
            let what = wire.map_or_else(String::new, |wire| format!("  {}", wire.what));
            let label = format!("{pin}{what}");
            let colour = if wire.is_some() { "#000" } else { "#aaa" };
            text += &match row as u8 {
                0 => format!(
                    "<text transform=\"translate({},190) rotate(-60)\" fill=\"{colour}\">{label}</text>\n",
                    px + 4.0
                ),
                1 => format!(
                    "<text transform=\"translate({},618) rotate(60)\" fill=\"{colour}\">{label}</text>\n",
                    px - 2.0
                ),
                2 => format!(
                    "<text x=\"838\" y=\"{}\" text-anchor=\"end\" fill=\"{colour}\">{label}</text>\n",
                    py + 4.0
                ),
                _ => {
                    format!("<text x=\"898\" y=\"{}\" fill=\"{colour}\">{label}</text>\n", py + 4.0)
                }
            };
        }
    }
    text + "</svg>\n"
}
