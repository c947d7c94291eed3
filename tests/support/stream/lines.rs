//! The lines of a stream. A line is made when its first byte is put on the line. It has a number that comes back in
//! its answer.

/// What a line does.
#[derive(Clone, Debug)]
pub enum What {
    /// Moves by a number of [`CELL`]s at a feed, mm/min; 0 means a traverse.
    Move(i8, u16),
    /// A move in JSON (`gc`), with its number (`tid`) before the block or behind it.
    Wrapped(i8, u16, bool),
    /// Waits, ms.
    Dwell(u16),
    /// Another block of G-code.
    Block(&'static str),
    /// Reads values: pairs of JSON.
    Read(&'static str),
    /// Asks for the state of the machine, and must be answered at once.
    Ask,
    /// Sets a value of the port's own, or reads it.
    Set(u16),
    Get,
    /// Drops what is queued; begins an alarm; ends an alarm.
    Flush,
    Alarm,
    Clear,
    /// A line that is longer than allowed.
    TooLong(u8),
}

/// A line that is yet to be made.
#[derive(Clone, Debug)]
pub struct Template {
    pub what: What,
    /// Its length, which comments or blanks fill up.
    pub len: u8,
    /// Number of blanks before it.
    pub lead: u8,
    pub end: End,
}

/// How a line ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    Feed,
    Return,
    Both,
    /// A line feed, and an empty line behind it.
    Empty,
}

impl End {
    pub fn bytes(self) -> &'static str {
        match self {
            End::Feed => "\n",
            End::Return => "\r",
            End::Both => "\r\n",
            End::Empty => "\n\n",
        }
    }
}

/// The order in which the machine handles a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// In the order in which lines come.
    Data,
    /// The line overtakes data wherever it waits.
    Short,
    /// The line overtakes data in the pool only.
    Long,
}

/// What a line has done if its answer is 0.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    None,
    /// An axis has moved, or will move, by a number of steps.
    Move(usize, i64),
    /// A spindle turns.
    Spindle,
    Ask,
    Set(u16),
    Get,
    Flush,
    Alarm,
    Clear,
}

/// A line.
#[derive(Clone, Debug)]
pub struct Line {
    pub text: String,
    pub kind: Kind,
    pub effect: Effect,
    /// Whether it may be refused as too long.
    pub too_long: bool,
}

/// The unit of moves, in steps and in mm.
pub const CELL: (i64, f64) = (32, 0.025);
pub const AXES: [&str; 3] = ["x", "y", "z"];
/// Longest line of each port (on the second, its ring limits it), and longest line that overtakes wherever it waits.
pub const LONGEST: [usize; 2] = [254, 60];
pub const SHORT: [usize; 2] = [40, 16];

impl Template {
    /// A template of natural length.
    pub fn plain(what: What) -> Self {
        Self { what, len: 0, lead: 0, end: End::Feed }
    }

    /// Returns the line for a port, with its number; moves move `axis`.
    pub fn line(&self, port: usize, id: u32, axis: usize) -> Line {
        let block = |way: i8, feed: u16| {
            let way = f64::from(way) * CELL.1;
            let axis = AXES[axis];
            match feed {
                0 => format!("g91 g0 {axis}{way:.3}"),
                feed => format!("g91 g1 f{feed} {axis}{way:.3}"),
            }
        };
        let moves = |way: i8| Effect::Move(axis, i64::from(way) * CELL.0);
        let user = if port == 0 { "uda0" } else { "udb0" };
        let (text, effect) = match &self.what {
            What::Move(way, feed) => (format!("N{id} {}", block(*way, *feed)), moves(*way)),
            What::Wrapped(way, feed, true) => {
                (format!("{{tid:{id},gc:\"{}\"}}", block(*way, *feed)), moves(*way))
            }
            What::Wrapped(way, feed, false) => {
                (format!("{{\"gc\":\"{}\",\"tid\":{id}}}", block(*way, *feed)), moves(*way))
            }
            What::Dwell(ms) => (format!("N{id} g4 p{:.3}", f64::from(*ms) / 1e3), Effect::None),
            What::Block(block) => {
                let turns = block.contains("m3") || block.contains("m4");
                (format!("N{id} {block}"), if turns { Effect::Spindle } else { Effect::None })
            }
            What::Read(pairs) => (format!("{{{pairs},tid:{id}}}"), Effect::None),
            What::Ask => (format!("{{stat:n,tid:{id}}}"), Effect::Ask),
            What::Set(value) => {
                (format!("{{{user}:\"0x{value:x}\",tid:{id}}}"), Effect::Set(*value))
            }
            What::Get => (format!("{{{user}:n,tid:{id}}}"), Effect::Get),
            What::Flush => (format!("{{qf:1,tid:{id}}}"), Effect::Flush),
            What::Alarm => (format!("{{alarm:1,tid:{id}}}"), Effect::Alarm),
            What::Clear => (format!("{{clear:n,tid:{id}}}"), Effect::Clear),
            // The second port's ring has no room for a line that is too long.
            What::TooLong(_) if port == 1 => (format!("N{id} (too long)"), Effect::None),
            What::TooLong(more) => {
                let pad = "x".repeat(LONGEST[port] + 1 + usize::from(*more % 40));
                (format!("N{id} ({pad})"), Effect::None)
            }
        };
        let too_long = port == 0 && matches!(self.what, What::TooLong(_));
        let text =
            if too_long { text } else { pad(text, usize::from(self.len).min(LONGEST[port])) };
        let kind = match &self.what {
            What::Wrapped(..) => Kind::Data,
            _ if text.starts_with('N') => Kind::Data,
            _ if text.len() <= SHORT[port] => Kind::Short,
            _ => Kind::Long,
        };
        Line { text, kind, effect, too_long }
    }
}

/// Returns the line, made longer by a comment or by blanks.
fn pad(text: String, len: usize) -> String {
    let more = len.saturating_sub(text.len());
    match text.split_at(1) {
        (_, _) if more == 0 => text,
        ("{", rest) => format!("{{{}{rest}", " ".repeat(more)),
        _ if more < 3 => text + &" ".repeat(more),
        _ => format!("{text} ({})", "c".repeat(more - 3)),
    }
}
