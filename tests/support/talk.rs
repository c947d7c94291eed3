//! A random conversation as it is had and judged, on the host or on the simulated chip.
//!
//! Whatever is sent, and whatever switches do: the machine comes to rest, every line is answered once, and where the
//! machine says that it is its motors are, by the steps that were made. Motors are where the position is but for an
//! *offset*, which only homing, a position that is set, or a reset changes; that of an axis that was homed at its
//! switch is known to the step.

use kerf::boards::inputs::{PROBE, X_MIN, Y_MIN, Z_MAX};
use kerf::boards::outputs;

use crate::deeds::{BY_HAND, Deed};
use crate::sender::Sender;
use crate::side::Side;

/// Lines in flight on each port.
const IN_FLIGHT: [usize; 2] = [4, 2];
/// Longest that the machine may take to come to rest, ms.
const REST_MS: u64 = 120_000;
/// `stat`: nothing runs.
const READY: f64 = 1.0;
const STOPPED: f64 = 3.0;
const ENDED: f64 = 4.0;
/// `stat`: G-code is refused.
const ALARM: f64 = 2.0;
const SHUTDOWN: f64 = 11.0;
/// Free blocks of an empty queue.
const BLOCKS: f64 = 64.0;
/// Positions are told to 0.001 mm, 1.28 steps, and steps are rounded.
const CLOSE: f64 = 1.2;
/// Steps of a homing axis until a switch is seen that changes while others do: 300 us at 10 mm/s, both ways.
const LATE: f64 = 10.0;
/// Steps in a unit of an axis: mm, or a degree.
const STEPS: [f64; 4] = [1280.0, 1280.0, 1280.0, 1600.0 / 360.0];

/// Where switches are that the machine works itself: that of X at its lower end, of Z at the upper one. Y has one out
/// of its reach, which is worked by hand.
const SWITCHES: [(usize, i64, bool); 4] = [
    (X_MIN, -7_680, false),
    (Z_MAX, 7_680, false),
    (PROBE, -3_840, false),
    (Y_MIN, -1_000_000_000, false),
];
/// Where an axis is when it has been homed: the position less the steps. Its switch lets go a step off where it
/// closes, 0.1 mm further on it is at the end of its travel, -6 mm and 6 mm.
const HOMED: [(usize, i64); 2] = [(0, -7_680 - (-7_679 + 128)), (2, 7_680 - (7_679 - 128))];
/// Faster than by default, and homing within a short way; M0 waits for a tilde.
const SETTINGS: [&str; 7] = [
    "{psw:1}",
    "{x:{vm:3000,fr:3000,jm:2000}}",
    "{y:{vm:3000,fr:3000,jm:2000}}",
    "{z:{vm:3000,fr:3000,jm:2000}}",
    "{xtn:-6,xtm:20,xsv:3000,xlv:600,xlb:1,xzb:0.1,xsx:0}",
    "{ytn:-3,ytm:3,ysv:3000,ylv:600,ylb:1,yzb:0.1,ysx:0}",
    "{ztn:-20,ztm:6,zsv:3000,zlv:600,zlb:1,zzb:0.1,zsn:0,a:{am:1,vm:100000,fr:100000,jm:100000}}",
];

/// What is known of an axis.
#[derive(Clone, Copy, Debug)]
struct Axis {
    /// Position less emitted steps.
    offset: i64,
    /// Whether that is to the step.
    exact: bool,
    /// It may have been homed at its switch since.
    homed: bool,
    /// It may be anything.
    doubted: bool,
}

/// A sender's side of a conversation, and what is known of the machine.
pub struct Talk<S> {
    side: S,
    ports: [Sender; 2],
    axes: [Axis; 4],
    /// Inputs that are closed by hand, as bits.
    closed: u16,
    /// Whether any of them has changed since positions were looked at.
    disturbed: bool,
    /// What has been done, for whoever looks for the reason of a failure.
    log: Vec<String>,
}

type Outcome<T> = Result<T, String>;

impl<S: Side> Talk<S> {
    /// With a machine that has not booted, or is about to say that it has.
    pub fn new(mut side: S) -> Self {
        side.wire(&SWITCHES);
        let axis = Axis { offset: 0, exact: true, homed: false, doubted: false };
        let ports = [Sender::new(0), Sender::new(1)];
        Self { side, ports, axes: [axis; 4], closed: 0, disturbed: false, log: Vec::new() }
    }

    /// Boots a machine that has never been used.
    pub fn begin(&mut self) -> Outcome<()> {
        self.greet()?;
        for line in SETTINGS {
            self.line(0, line)?;
        }
        // They are stored.
        self.run(2_000)?;
        self.rest()
    }

    /// The machine boots: it says so, stands where it stands, and calls that 0.
    pub fn greet(&mut self) -> Outcome<()> {
        self.ports.iter_mut().for_each(Sender::reset);
        let mut waited = 0;
        while self.ports.iter().any(|port| port.banners == 0) {
            self.run(10)?;
            waited += 10;
            if waited > 3_000 {
                return Err("no SYSTEM READY".to_string());
            }
        }
        for (axis, steps) in self.axes.iter_mut().zip(self.side.steps()) {
            *axis = Axis { offset: -steps, exact: true, homed: false, doubted: false };
        }
        Ok(())
    }

    /// Does all that. After a reset it is the rest of it that is still to be done.
    pub fn play<'a>(&mut self, deeds: &'a [Deed]) -> Outcome<Option<&'a [Deed]>> {
        for (at, deed) in deeds.iter().enumerate() {
            self.log.push(format!("{deed:?}"));
            match deed {
                Deed::Line(port, line) => self.line(*port, line)?,
                Deed::Characters(port, characters) => self.send(*port, characters),
                Deed::Within(before, characters, after) => {
                    self.patience(0)?;
                    self.expect(before);
                    self.expect(after);
                    self.send(
                        0,
                        &[before.as_bytes(), characters, after.as_bytes(), b"\n"].concat(),
                    );
                }
                Deed::Input(input, closed) => self.work(*input, *closed),
                Deed::Hold(hold) => self.side.set_aux_cts(*hold),
                Deed::Wait(ms) => self.run(*ms)?,
                Deed::Rest => self.rest()?,
                Deed::Reset => {
                    self.relieve();
                    // Nothing is on its way that would come into the start.
                    self.run(20)?;
                    self.send(0, b"\x18");
                    return Ok(deeds.get(at + 1..));
                }
            }
        }
        Ok(None)
    }

    /// Comes to rest, and goes to a place that is known to the step, near where the motors were at first.
    pub fn finish(&mut self) -> Outcome<()> {
        self.rest()?;
        // Multiples of these are whole steps.
        let grid = [(32, 0.025), (32, 0.025), (32, 0.025), (40, 9.0)];
        let cells: [i64; 4] =
            std::array::from_fn(|m| (self.axes[m].offset + 640).div_euclid(grid[m].0));
        let place: [f64; 4] = std::array::from_fn(|m| cells[m] as f64 * grid[m].1);
        let [x, y, z, a] = place;
        self.line(0, &format!("g21 g90 g94 g53 g0 x{x:.3} y{y:.3} z{z:.3} a{a:.3}"))?;
        self.rest()?;
        let steps = self.side.steps();
        for (m, (axis, steps)) in self.axes.iter_mut().zip(steps).enumerate() {
            let offset = cells[m] * grid[m].0 - steps;
            if axis.exact && axis.offset != offset {
                let off = axis.offset - offset;
                return Err(format!("motor {} rests {off} steps off its place, at {steps}", m + 1));
            }
            (axis.offset, axis.exact) = (offset, true);
        }
        self.log.clear();
        self.ports.iter_mut().for_each(|port| port.heard.clear());
        Ok(())
    }

    /// All that was done, and heard, of a conversation that failed.
    pub fn story(&self) -> String {
        let log = self.log.iter().map(|done| format!("  {done}\n"));
        let heard = self.ports.iter().enumerate();
        let heard = heard.flat_map(|(n, port)| port.heard.iter().map(move |line| (n, line)));
        let heard = heard.map(|(n, line)| format!("  {n}: {line}\n"));
        log.chain(["heard\n".to_string()]).chain(heard).collect()
    }

    /// Lets time pass.
    pub fn run(&mut self, ms: u64) -> Outcome<()> {
        self.side.run_ms(ms);
        for port in &mut self.ports {
            port.hear(&mut self.side)?;
        }
        Ok(())
    }

    fn send(&mut self, port: usize, bytes: &[u8]) {
        self.ports[port].send(&mut self.side, bytes);
    }

    /// Sends a line when fewer than it may wait for their answers.
    fn line(&mut self, port: usize, line: &str) -> Outcome<()> {
        self.patience(port)?;
        self.expect(line);
        self.send(port, format!("{line}\n").as_bytes());
        Ok(())
    }

    /// Waits until another line may be sent.
    fn patience(&mut self, port: usize) -> Outcome<()> {
        let mut waited = 0;
        while self.ports[port].in_flight() >= IN_FLIGHT[port] {
            self.run(20)?;
            waited += 20;
            // It may be held, with the queue full.
            if waited % 400 == 0 {
                self.relieve();
            }
            if waited > REST_MS {
                return Err(format!("no answer on port {port}"));
            }
        }
        Ok(())
    }

    /// Lets go of all that keeps the machine from moving.
    fn relieve(&mut self) {
        for input in BY_HAND {
            if self.closed & 1 << input != 0 {
                self.work(input, false);
            }
        }
        self.side.set_aux_cts(false);
        self.send(0, b"~");
    }

    /// Works an input by hand. While a switch is looked at for having changed, another is seen later than by itself.
    fn work(&mut self, input: usize, closed: bool) {
        self.closed = self.closed & !(1 << input) | u16::from(closed) << input;
        self.disturbed = true;
        self.side.set_input(input, closed);
    }

    /// What a line may do to positions.
    fn expect(&mut self, line: &str) {
        let homes_all = line.contains("{home:1}");
        let homes = |axis: &str| homes_all || line.contains("g28.2") && line.contains(axis);
        self.axes[0].homed |= homes("x");
        self.axes[2].homed |= homes("z");
        // Its switch is worked by hand.
        self.axes[1].doubted |= homes("y");
        if line.contains("g28.3") {
            self.axes.iter_mut().for_each(|axis| axis.doubted = true);
        }
    }

    /// Waits until the machine is at rest, and looks whether it is where it says, and does what it says.
    fn rest(&mut self) -> Outcome<()> {
        let (mut before, mut waited) = (None, 0);
        while !self.is_at_rest(&mut before)? {
            self.relieve();
            self.run(50)?;
            waited += 50;
            if waited > REST_MS {
                return Err("the machine does not come to rest".to_string());
            }
        }
        self.check_position()?;
        self.check_outputs()?;
        match self.ports.iter().map(|port| port.jogs).sum() {
            0 => Ok(()),
            jogs => Err(format!("{jogs} jogs have no end")),
        }
    }

    /// Whether nothing moves and nothing waits; an alarm is cleared.
    fn is_at_rest(&mut self, before: &mut Option<[i64; 4]>) -> Outcome<bool> {
        let steps = self.side.steps();
        let still = before.replace(steps) == Some(steps);
        if !still || self.ports.iter().any(|port| port.in_flight() > 0) {
            return Ok(false);
        }
        let Some(told) = self.ask("{stat:n,qr:n}", "stat")? else { return Ok(false) };
        match number(&told, "") {
            Some(ALARM | SHUTDOWN) => {
                self.ask("{clear:n}", "clear")?;
                Ok(false)
            }
            Some(READY | STOPPED | ENDED) => Ok(number(&told, "\"qr\":") == Some(BLOCKS)),
            _ => Ok(false),
        }
    }

    /// Asks, and waits for the answer: what stands behind `name` in it. `None` if it was dropped by a queue flush.
    fn ask(&mut self, line: &str, name: &str) -> Outcome<Option<String>> {
        self.line(0, line)?;
        let mut waited = 0;
        while self.ports[0].in_flight() > 0 {
            self.run(2)?;
            waited += 2;
            if waited > REST_MS {
                return Err(format!("{line} is not answered"));
            }
        }
        Ok(self.ports[0].told(name).map(str::to_string))
    }

    fn check_position(&mut self) -> Outcome<()> {
        let Some(told) = self.ask("{mpo:n}", "mpo")? else { return Err("no position".to_string()) };
        let steps = self.side.steps();
        for (m, (axis, steps)) in self.axes.iter_mut().zip(steps).enumerate() {
            let name = ["\"x\":", "\"y\":", "\"z\":", "\"a\":"][m];
            let position = number(&told, name).ok_or_else(|| format!("no {name} in {told}"))?;
            let at = position * STEPS[m] - steps as f64;
            let homed = HOMED.iter().find(|(axis, _)| *axis == m).filter(|_| axis.homed);
            let within = |close: f64, offset: i64| (at - offset as f64).abs() < close;
            let near = |offset| within(if axis.exact { CLOSE } else { 2.0 * CLOSE }, offset);
            if near(axis.offset) && !axis.doubted {
                // As it was; or both.
                axis.exact &=
                    homed.is_none_or(|(_, offset)| *offset == axis.offset || !near(*offset));
            } else if let Some((_, offset)) = homed.filter(|(_, offset)| near(*offset)) {
                (axis.offset, axis.exact) = (*offset, !axis.doubted && !self.disturbed);
            } else if axis.doubted || self.disturbed && homed.is_some_and(|(_, o)| within(LATE, *o))
            {
                (axis.offset, axis.exact) = (at.round() as i64, false);
            } else {
                let wrong = at - axis.offset as f64;
                return Err(format!("motor {} is {wrong:.1} steps off what {told} says", m + 1));
            }
            (axis.homed, axis.doubted) = (false, false);
        }
        self.disturbed = self.closed != 0;
        Ok(())
    }

    fn check_outputs(&mut self) -> Outcome<()> {
        let Some(told) = self.ask("{spe:n,spd:n,com:n,cof:n}", "spe")? else {
            return Err("no outputs".to_string());
        };
        let is = |name, bit| if number(&told, name) == Some(1.0) { bit } else { 0 };
        let turns = is("", outputs::SPINDLE);
        let told_on = turns
            | if turns != 0 { is("\"spd\":", outputs::COUNTERCLOCKWISE) } else { 0 }
            | is("\"com\":", outputs::MIST)
            | is("\"cof\":", outputs::FLOOD);
        let (on, _) = self.side.outputs();
        let on = if on & outputs::SPINDLE == 0 { on & !outputs::COUNTERCLOCKWISE } else { on };
        match on == told_on {
            true => Ok(()),
            false => Err(format!("outputs are {on:#b}, and {told}")),
        }
    }
}

/// The number behind a text.
fn number(line: &str, text: &str) -> Option<f64> {
    let rest = &line[line.find(text)? + text.len()..];
    rest.split([',', '}']).next()?.parse().ok()
}
