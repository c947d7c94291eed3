//! Writes canonical commands as plain G-code: absolute, in millimetres, without offsets and cycles, every word on
//! every line.

use kerf::canon::Canon;
use kerf::gcode::command::{Arc, Feed, Spindle};
use kerf::gcode::modal::{MotionMode, Turn};
use kerf::units::{AXES, AXIS_LETTERS, Length, PerAxis};

/// The text so far, and the state that it leads to.
struct Plain {
    text: String,
    place: PerAxis<Length>,
    rate: Option<Feed>,
    exact: bool,
}

/// Writes the commands, one line each. A command that is part of another command's line gets no line.
pub fn plain(commands: &[Canon]) -> String {
    let mut plain =
        Plain { text: String::new(), place: [Length::ZERO; AXES], rate: None, exact: false };
    for (index, command) in commands.iter().enumerate() {
        let before = index.checked_sub(1).and_then(|index| commands.get(index));
        plain.take(before, command, commands.get(index + 1));
    }
    plain.text
}

impl Plain {
    fn take(&mut self, before: Option<&Canon>, command: &Canon, next: Option<&Canon>) {
        let line = match command {
            Canon::Rate(feed) => return self.rate = Some(*feed),
            Canon::ExactStop(on) => return self.exact = *on,
            Canon::Traverse(to) => format!("{} G0{}", self.path(), self.go(to)),
            Canon::Feed(to) => format!("{}{} G1{}", self.path(), self.feed(), self.go(to)),
            Canon::Arc(to, arc, turns) => self.arc(to, arc, *turns),
            Canon::Thread(to, lead) => {
                let path = self.path();
                format!("{path} G33{} K{lead}", self.go(to))
            }
            Canon::Probe(to, mode) => {
                let code = probing(*mode);
                let words = self.go(to);
                // Rotary axes do not probe.
                let linear = words.split(" A").next().unwrap();
                format!("{}{} {code}{linear}", self.path(), self.feed())
            }
            Canon::Dwell(ms) => format!("G4 P{}.{:03}", ms / 1_000, ms % 1_000),
            // The tool change that follows does this.
            Canon::Spindle(_) if matches!(next, Some(Canon::Tool(_))) => return,
            Canon::Spindle(Spindle { turn, speed }) => match turn {
                Turn::Off => "M5".into(),
                Turn::Clockwise => format!("M3 S{speed}"),
                Turn::Counterclockwise => format!("M4 S{speed}"),
            },
            // M9 switches both off.
            Canon::Flood(false) if matches!(before, Some(Canon::Mist(false))) => return,
            Canon::Mist(false) | Canon::Flood(false) => "M9".into(),
            Canon::Mist(true) => "M7".into(),
            Canon::Flood(true) => "M8".into(),
            Canon::Tool(number) => format!("T{number} M6"),
            Canon::SetPosition(to) => format!("G28.3{}", self.go(to)),
            Canon::Home(axes, set) => {
                let axes = (0..AXES).filter(|axis| axes & 1 << axis != 0);
                let words: String =
                    axes.map(|axis| format!(" {}0", char::from(AXIS_LETTERS[axis]))).collect();
                format!("{}{words}", if *set { "G28.2" } else { "G28.4" })
            }
            Canon::Message(text) => format!("(MSG {text})"),
            Canon::Stop => "M0".into(),
            Canon::End => "M2".into(),
            Canon::Overrides(_) => unreachable!("they are written one by one"),
            Canon::Heat(_) => unreachable!("no program of these tests heats"),
        };
        self.text += &line;
        self.text.push('\n');
    }

    fn path(&self) -> &'static str {
        if self.exact { "G61.1" } else { "G61" }
    }

    fn feed(&self) -> String {
        match self.rate.expect("a rate comes first") {
            Feed::PerMinute(rate) => format!(" G94 F{rate}"),
            Feed::Minutes(minutes) => format!(" G93 F{}", 1.0 / minutes),
        }
    }

    fn go(&mut self, to: &PerAxis<Length>) -> String {
        self.place = *to;
        let words = to.iter().zip(AXIS_LETTERS);
        words
            .map(|(at, letter)| format!(" {}{at}", char::from(letter).to_ascii_uppercase()))
            .collect()
    }

    fn arc(&mut self, to: &PerAxis<Length>, arc: &Arc, turns: i32) -> String {
        let axes = [arc.first, arc.second].map(usize::from);
        let offsets = axes.iter().zip(arc.center).map(|(axis, center)| {
            let offset = center.checked_sub(self.place[*axis]).unwrap();
            format!(" {}{offset}", ["I", "J", "K"][*axis])
        });
        let offsets: String = offsets.collect();
        let plane = ["G19", "G18", "G17"][usize::from(arc.linear)];
        let code = if turns < 0 { "G2" } else { "G3" };
        // P counts the turns that are begun.
        let turns = turns.unsigned_abs();
        let (path, feed) = (self.path(), self.feed());
        format!("{path}{feed} {plane} {code}{}{offsets} P{turns}", self.go(to))
    }
}

fn probing(mode: MotionMode) -> &'static str {
    match mode {
        MotionMode::ProbeTowardsQuietly => "G38.3",
        MotionMode::ProbeAway => "G38.4",
        MotionMode::ProbeAwayQuietly => "G38.5",
        _ => "G38.2",
    }
}
