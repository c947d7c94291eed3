//! The interface of a dialect, and the table of dialects.
//!
//! A dialect is a folder beside this file with a type that implements [`Dialect`], and a row of `dialects!` below.
//! For each associated type of [`Dialect`] the macro makes an enum with one variant per dialect that is built in. In
//! an image with a single dialect these enums cost neither memory nor time.

use super::Rewritten;
use super::line::{Ending, Next, Span};
use super::machine::Machine;
use super::notice::Notice;
use super::out::Out;
use crate::config::Settings;
use crate::machine::Alarm;
use crate::status::Status;

/// Periods of messages that the board sends without a request; 0 for none.
pub struct Intervals {
    /// Of [`Notice::Temperatures`], s.
    pub temperatures_s: u8,
    /// Of [`Notice::Busy`], s.
    pub busy_s: u8,
}

/// A way to speak to senders. All of it runs in thread mode. Lines are passed without their line ends.
pub trait Dialect {
    /// How a port is spoken to, where the dialect has several ways; kept per port. The default applies until the
    /// settings have been read.
    type Speech: Copy + Default;
    /// A line that is being answered.
    type Request: Answers;
    /// A notice that is being sent.
    type Telling: Tells;
    /// What the dialect remembers from one report to the next.
    type Memory: Remembers;

    /// Whether lines, empty ones included, are answered in the order in which they arrive. In such a dialect `?` and
    /// bytes above 0x7F are taken out of lines wherever they stand.
    const IN_ORDER: bool = false;

    /// Whether this is the dialect of a printing host. In such a dialect `!`, `~`, `%` and bytes above 0x7F are plain
    /// text, blocks are [rewritten](Dialect::rewrite), and only lines that are control lines in this dialect overtake
    /// others.
    const IS_PLAIN: bool = false;

    /// Whether the settings select this dialect for a port. If the settings select no dialect, the port starts in the
    /// first dialect of the table.
    fn is_chosen(settings: &Settings, port: u8) -> bool {
        let _ = (settings, port);
        false
    }

    /// Whether a line is valid in this dialect alone. Such a line decides the dialect of a port that is still
    /// undecided.
    fn is_decided_by(line: &[u8]) -> bool;

    /// Whether a line that decides a dialect may begin with this byte: an underestimate is a defect.
    fn may_be_decided_by(first: u8) -> bool;

    /// Returns the words of a jog (G-code that moves and changes no mode); `None` if the block is not a jog.
    fn jog(block: &[u8]) -> Option<&[u8]> {
        let _ = block;
        None
    }

    /// Returns how ports are spoken to after a start.
    fn speech(settings: &Settings) -> Self::Speech;

    /// Returns how lines of a file on the SD card are taken: they are in no order, and nobody waits for their answers.
    fn in_file(settings: &Settings) -> Self::Speech {
        Self::speech(settings)
    }

    /// Starts to answer a line, which the sender counts as `length` bytes. `None` if there is nothing to answer. The
    /// line may change `speech`, and so how the port is spoken to from now on.
    fn begin(
        line: &[u8],
        length: u16,
        speech: &mut Self::Speech,
        settings: &Settings,
    ) -> Option<Self::Request>;

    /// Returns the request for a single `?`: a status report. `None` in dialects that do not take `?` out of lines.
    fn question() -> Option<Self::Request> {
        None
    }

    /// Answers, with a status, a line that could not be stored. `line` is what is left of the line.
    fn refuse(
        status: Status,
        line: &[u8],
        length: u16,
        speech: &mut Self::Speech,
        settings: &Settings,
    ) -> Self::Request;

    /// Translates a block of a [plain](Dialect::IS_PLAIN) dialect into the words of the interpreter.
    fn rewrite<'a>(block: &[u8], out: &'a mut Rewritten) -> Result<&'a [u8], Status> {
        out.clear();
        out.extend_from_slice(block).map_err(|_| Status::InputTooLong)?;
        Ok(out)
    }

    /// Returns the number of lines begun so far, if the dialect reports that a line takes long ([`Notice::Busy`]);
    /// else `None`.
    fn activity(speech: Self::Speech) -> Option<u8> {
        let _ = speech;
        None
    }

    /// Returns the periods of the messages that the board sends without a request.
    fn intervals(memory: &Self::Memory) -> Intervals {
        let _ = memory;
        Intervals { temperatures_s: 0, busy_s: 0 }
    }

    /// Starts to send a notice about the present state of the machine.
    fn tell(notice: Notice, speech: Self::Speech, machine: &mut impl Machine) -> Self::Telling;

    /// Returns which blocks [`Dialect::put_brief`] answers, among the blocks of G-code that run and have no comment:
    /// `Some(true)` all of them, `Some(false)` those without a line number, `None` none. Called before each line: a
    /// few cycles.
    fn brief(speech: Self::Speech, settings: &Settings) -> Option<bool>;

    /// Takes the block of a line in the usual form of a [plain](Dialect::IS_PLAIN) dialect, and counts the line.
    /// `None` if the line needs the full parser; nothing is changed then. If the block is a usual move,
    /// [`Dialect::put_brief`] answers it.
    #[inline(always)]
    fn fast_path(line: &[u8], speech: &mut Self::Speech) -> Option<Span> {
        let _ = (line, speech);
        None
    }

    /// Writes the whole answer to a block that [`Dialect::brief`] or [`Dialect::fast_path`] selects. Called for each
    /// usual move, so its cost is part of the budget of a move.
    fn put_brief(settings: &Settings, ending: Ending, out: &mut impl Out);

    /// Writes the line end.
    fn put_line_end(settings: &Settings, out: &mut impl Out);

    /// Whether empty lines are answered.
    fn answers_empty(speech: Self::Speech) -> bool;

    /// Whether a [control line](Dialect::is_control) may begin with this byte.
    fn may_be_control(first: u8) -> bool;

    /// Whether a line is a control line: one that overtakes waiting G-code.
    fn is_control(line: &[u8]) -> bool;

    /// Returns the alarm that a line raises on arrival, before the line is answered; `None` for most lines. The line
    /// has at most [`STOP_MAX`](super::STOP_MAX) bytes.
    fn asks_alarm(line: &[u8]) -> Option<Alarm>;

    /// Whether a line ends an alarm.
    fn ends_alarm(line: &[u8]) -> bool;
}

/// A line that is being answered. The answer starts only after the G-code of the line has run.
pub trait Answers {
    /// Returns the G-code that the next step would request with [`Next::Gcode`], if that is known already.
    fn gcode(&self) -> Option<Span>;

    /// Takes the status with which that G-code has run. `comment`: whether the G-code may contain a comment.
    fn ran(&mut self, status: Status, comment: bool);

    /// Does the next part of the work and writes at most [`CHUNK`](super::CHUNK) bytes. The caller passes the line
    /// anew each time.
    fn step(&mut self, line: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Next;

    /// Whether a part of the answer has been written.
    fn has_begun(&self) -> bool;

    /// Puts a status report in front of the rest of the answer, unless the answer is in the middle of a line. Returns
    /// whether the report is sent.
    fn interject(&mut self) -> bool {
        false
    }

    /// Notes that the line has been dropped since its answer was begun, by an alarm or by a sender. May be called more
    /// than once.
    fn dropped(&mut self) {}

    /// Whether the answer is a list. The caller then keeps little output queued, so that a `?` is answered soon.
    fn is_list(&self) -> bool {
        false
    }

    /// Whether the next step needs the machine at rest. Until then the line waits as G-code does, and other lines
    /// overtake it.
    fn awaits_rest(&self, line: &[u8]) -> bool {
        let _ = line;
        false
    }
}

/// A notice that is being sent.
pub trait Tells {
    /// Writes the next part, at most [`CHUNK`](super::CHUNK) bytes. Returns whether there is more.
    fn step(&mut self, machine: &mut impl Machine, out: &mut impl Out) -> bool;

    /// Ends the output line here, so that an answer can be sent in between. The rest follows in a line of its own.
    /// Returns `false` if the output cannot be divided here.
    fn split(&mut self, out: &mut impl Out) -> bool {
        let _ = out;
        false
    }

    /// Returns the number of free blocks that a queue report has reported.
    fn blocks_free(&self) -> usize {
        0
    }
}

/// What dialects remember from one report to the next.
pub trait Remembers {
    /// Makes an empty value. The caller calls [`Remembers::restore`] once the value is in its place, because the
    /// stack is small where the value is made.
    fn new() -> Self;

    /// Restores the defaults. Called after the settings have been set to their defaults.
    fn restore(&mut self);

    /// Makes the next report complete, because its reader has received no report so far.
    fn refresh(&mut self);
}

macro_rules! dialects {
    ($($(#[$what:meta])* $field:ident: $name:ident($dialect:ty) if $feature:literal;)+) => {
        #[cfg(not(any($(feature = $feature),+)))]
        compile_error!("an image needs a dialect: one of the features `dialect-...`");

        /// How a port is spoken to: the dialect, and what the dialect keeps per port.
        #[derive(Clone, Copy)]
        pub enum Speech {
            $($(#[$what])* #[cfg(feature = $feature)] $name(<$dialect as Dialect>::Speech),)+
        }

        /// A line that is being answered.
        pub enum Request {
            $($(#[$what])* #[cfg(feature = $feature)] $name(<$dialect as Dialect>::Request),)+
        }

        /// A notice that is being sent.
        pub enum Telling {
            $($(#[$what])* #[cfg(feature = $feature)] $name(<$dialect as Dialect>::Telling),)+
        }

        /// What the dialects remember from one report to the next.
        pub struct Memory {
            $($(#[$what])* #[cfg(feature = $feature)] pub $field: <$dialect as Dialect>::Memory,)+
        }

        impl Default for Speech {
            /// The first dialect of the table that is built in.
            #[allow(unreachable_code)]
            fn default() -> Self {
                $(#[cfg(feature = $feature)]
                { return Self::$name(Default::default()); })+
            }
        }

        impl Speech {
            /// Whether the image has several dialects, so that a sender may choose.
            pub const IS_CHOSEN: bool = 1 < 0 $(+ cfg!(feature = $feature) as usize)+;

            /// Returns how a port is spoken to after a start: in the dialect that the settings select, else in the one
            /// whose senders begin with anything ([`Dialect::IN_ORDER`]), else in the first one of the table that is
            /// built in.
            #[allow(unreachable_code)]
            #[inline(always)]
            pub fn at_start(settings: &Settings, port: u8) -> Self {
                $(#[cfg(feature = $feature)]
                if <$dialect>::is_chosen(settings, port) {
                    return Self::$name(<$dialect>::speech(settings));
                })+
                if let Some(speech) = Self::of_question(settings)
                    && settings.lets_senders_choose(port)
                {
                    return speech;
                }
                $(#[cfg(feature = $feature)]
                { return Self::$name(<$dialect>::speech(settings)); })+
            }

            /// Returns the dialect in which alone a line is valid, if there is one: see [`Dialect::is_decided_by`].
            #[small]
            pub fn decided_by(line: &[u8], settings: &Settings) -> Option<Self> {
                $(#[cfg(feature = $feature)]
                if <$dialect>::is_decided_by(line) {
                    return Some(Self::$name(<$dialect>::speech(settings)));
                })+
                None
            }

            /// See [`Dialect::may_be_decided_by`]. Blanks may stand before any line.
            #[inline(always)]
            pub fn may_be_decided_by(first: u8) -> bool {
                let mut may = first <= b' ';
                $(#[cfg(feature = $feature)]
                { may |= <$dialect>::may_be_decided_by(first); })+
                may
            }

            /// Returns the dialect whose senders ask with a single `?`, if it is built in.
            #[small]
            pub fn of_question(settings: &Settings) -> Option<Self> {
                $(#[cfg(feature = $feature)]
                if <$dialect>::IN_ORDER {
                    return Some(Self::$name(<$dialect>::speech(settings)));
                })+
                None
            }

            /// Returns the dialect of the greeting that an undecided port sends before its own: the first one of the
            /// table that is built in, if the port's own is that of senders who ask with a single `?`; else that of
            /// printing hosts.
            #[small]
            pub fn of_other_greeting(settings: &Settings) -> Option<Self> {
                $(#[cfg(feature = $feature)]
                if <$dialect>::IS_PLAIN || (Self::HAS_QUESTION && !<$dialect>::IN_ORDER) {
                    return Some(Self::$name(<$dialect>::speech(settings)));
                })+
                None
            }

            /// Whether the image has a dialect whose senders ask with a single `?`.
            pub const HAS_QUESTION: bool = {
                let mut has = false;
                $(#[cfg(feature = $feature)]
                { has |= <$dialect>::IN_ORDER; })+
                has
            };

            /// Whether the image has a [plain](Dialect::IS_PLAIN) dialect.
            pub const HAS_PLAIN: bool = {
                let mut has = false;
                $(#[cfg(feature = $feature)]
                { has |= <$dialect>::IS_PLAIN; })+
                has
            };

            /// See [`Dialect::in_file`].
            #[cfg(feature = "sd")]
            pub fn in_file(self, settings: &Settings) -> Self {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(_) => Self::$name(<$dialect>::in_file(settings)),)+
                }
            }

            /// See [`Dialect::IS_PLAIN`].
            #[inline(always)]
            pub fn is_plain(self) -> bool {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(_) => <$dialect>::IS_PLAIN,)+
                }
            }

            /// See [`Dialect::rewrite`].
            #[inline(always)]
            pub fn rewrite<'a>(self, block: &[u8], out: &'a mut Rewritten) -> Result<&'a [u8], Status> {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(_) => <$dialect>::rewrite(block, out),)+
                }
            }

            /// See [`Dialect::activity`].
            #[inline(always)]
            pub fn activity(self) -> Option<u8> {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(speech) => <$dialect>::activity(speech),)+
                }
            }

            /// See [`Dialect::intervals`].
            #[inline(always)]
            pub fn intervals(self, memory: &Memory) -> Intervals {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(_) => <$dialect>::intervals(&memory.$field),)+
                }
            }

            /// See [`Dialect::IN_ORDER`].
            #[inline(always)]
            pub fn is_in_order(self) -> bool {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(_) => <$dialect>::IN_ORDER,)+
                }
            }

            /// See [`Dialect::brief`].
            #[inline(always)]
            pub fn brief(self, settings: &Settings) -> Option<bool> {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(speech) => <$dialect>::brief(speech, settings),)+
                }
            }

            /// See [`Dialect::fast_path`].
            #[inline(always)]
            pub fn fast_path(&mut self, line: &[u8]) -> Option<Span> {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(speech) => <$dialect>::fast_path(line, speech),)+
                }
            }

            /// See [`Dialect::put_brief`].
            #[inline(always)]
            pub fn put_brief(self, settings: &Settings, ending: Ending, out: &mut impl Out) {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(_) => <$dialect>::put_brief(settings, ending, out),)+
                }
            }

            /// See [`Dialect::put_line_end`].
            #[inline(always)]
            pub fn put_line_end(self, settings: &Settings, out: &mut impl Out) {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(_) => <$dialect>::put_line_end(settings, out),)+
                }
            }

            /// See [`Dialect::answers_empty`].
            #[inline(always)]
            pub fn answers_empty(self) -> bool {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(speech) => <$dialect>::answers_empty(speech),)+
                }
            }
        }

        impl Request {
            /// See [`Dialect::begin`].
            #[inline(always)]
            pub fn begin(
                line: &[u8],
                length: u16,
                speech: &mut Speech,
                settings: &Settings,
            ) -> Option<Self> {
                match speech {
                    $(#[cfg(feature = $feature)]
                    Speech::$name(speech) => {
                        <$dialect>::begin(line, length, speech, settings).map(Self::$name)
                    })+
                }
            }

            /// See [`Dialect::question`].
            #[inline(always)]
            pub fn question(speech: Speech) -> Option<Self> {
                match speech {
                    $(#[cfg(feature = $feature)]
                    Speech::$name(_) => <$dialect>::question().map(Self::$name),)+
                }
            }

            /// See [`Dialect::refuse`].
            #[inline(always)]
            pub fn refused(
                status: Status,
                line: &[u8],
                length: u16,
                speech: &mut Speech,
                settings: &Settings,
            ) -> Self {
                match speech {
                    $(#[cfg(feature = $feature)]
                    Speech::$name(speech) => {
                        Self::$name(<$dialect>::refuse(status, line, length, speech, settings))
                    })+
                }
            }
        }

        impl Answers for Request {
            #[inline(always)]
            fn gcode(&self) -> Option<Span> {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(request) => request.gcode(),)+
                }
            }

            #[inline(never)]
            fn ran(&mut self, status: Status, comment: bool) {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(request) => request.ran(status, comment),)+
                }
            }

            #[inline(always)]
            fn step(&mut self, line: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Next {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(request) => request.step(line, machine, out),)+
                }
            }

            #[inline(always)]
            fn has_begun(&self) -> bool {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(request) => request.has_begun(),)+
                }
            }

            #[inline(always)]
            fn interject(&mut self) -> bool {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(request) => request.interject(),)+
                }
            }

            #[inline(always)]
            fn dropped(&mut self) {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(request) => request.dropped(),)+
                }
            }

            #[inline(always)]
            fn awaits_rest(&self, line: &[u8]) -> bool {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(request) => request.awaits_rest(line),)+
                }
            }

            #[inline(always)]
            fn is_list(&self) -> bool {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(request) => request.is_list(),)+
                }
            }
        }

        impl Telling {
            /// See [`Dialect::tell`].
            #[inline(always)]
            pub fn begin(notice: Notice, speech: Speech, machine: &mut impl Machine) -> Self {
                match speech {
                    $(#[cfg(feature = $feature)]
                    Speech::$name(speech) => {
                        Self::$name(<$dialect>::tell(notice, speech, machine))
                    })+
                }
            }
        }

        impl Tells for Telling {
            #[inline(always)]
            fn step(&mut self, machine: &mut impl Machine, out: &mut impl Out) -> bool {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(telling) => telling.step(machine, out),)+
                }
            }

            #[inline(always)]
            fn split(&mut self, out: &mut impl Out) -> bool {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(telling) => telling.split(out),)+
                }
            }

            #[inline(always)]
            fn blocks_free(&self) -> usize {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(telling) => telling.blocks_free(),)+
                }
            }
        }

        impl Remembers for Memory {
            #[inline(always)]
            fn new() -> Self {
                Self { $(#[cfg(feature = $feature)] $field: Remembers::new(),)+ }
            }

            fn restore(&mut self) {
                $(#[cfg(feature = $feature)] self.$field.restore();)+
            }

            fn refresh(&mut self) {
                $(#[cfg(feature = $feature)] self.$field.refresh();)+
            }
        }

        /// See [`Dialect::jog`]. Tries all dialects that are built in.
        #[inline(always)]
        pub fn jog(block: &[u8]) -> Option<&[u8]> {
            let mut words = None;
            $(#[cfg(feature = $feature)]
            { words = words.or_else(|| <$dialect>::jog(block)); })+
            words
        }

        /// See [`Dialect::may_be_control`]. Tries all dialects that are built in.
        #[inline(always)]
        pub fn may_be_control(first: u8) -> bool {
            let mut may = false;
            $(#[cfg(feature = $feature)]
            { may |= <$dialect>::may_be_control(first); })+
            may
        }

        /// See [`Dialect::is_control`]. Tries the dialects that are built in and whose [`Dialect::IS_PLAIN`] equals
        /// `plain`.
        #[inline(always)]
        pub fn is_control(line: &[u8], plain: bool) -> bool {
            let mut is = false;
            $(#[cfg(feature = $feature)]
            { is = is || (<$dialect>::IS_PLAIN == plain && <$dialect>::is_control(line)); })+
            is
        }

        /// See [`Dialect::asks_alarm`]. Tries the dialects that are built in and whose [`Dialect::IS_PLAIN`] equals
        /// `plain`.
        #[inline(always)]
        pub fn asks_alarm(line: &[u8], plain: bool) -> Option<Alarm> {
            let mut alarm = None;
            $(#[cfg(feature = $feature)]
            if <$dialect>::IS_PLAIN == plain {
                alarm = alarm.or_else(|| <$dialect>::asks_alarm(line));
            })+
            alarm
        }

        /// See [`Dialect::ends_alarm`]. Tries the dialects as [`asks_alarm`] does.
        #[inline(always)]
        pub fn ends_alarm(line: &[u8], plain: bool) -> bool {
            let mut ends = false;
            $(#[cfg(feature = $feature)]
            { ends = ends || (<$dialect>::IS_PLAIN == plain && <$dialect>::ends_alarm(line)); })+
            ends
        }
    };
}

dialects! {
    /// The dialect of TinyG and g2core.
    tinyg: Tinyg(super::tinyg::Tinyg) if "dialect-tinyg";
    /// The dialect of grbl 1.1.
    grbl: Grbl(super::grbl::Grbl) if "dialect-grbl";
    /// The dialect of printing hosts.
    reprap: RepRap(super::reprap::RepRap) if "dialect-reprap";
}
