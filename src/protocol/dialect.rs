//! What a dialect has to have, and which dialects there are.
//!
//! A dialect is a folder beside this file with a type that implements [`Dialect`], and a row of `dialects!` below. The table makes an
//! enum of each of its types, with a variant for each dialect that is built in. Of an image with one dialect the variants
//! take neither room nor time.

use super::Rewritten;
use super::line::{Ending, Next, Span};
use super::machine::Machine;
use super::notice::Notice;
use super::out::Out;
use crate::config::Settings;
use crate::machine::Alarm;
use crate::status::Status;

/// A way to speak to senders. All of it runs in thread mode; lines are without their ends.
pub trait Dialect {
    /// How a port is spoken to, if there are several ways; kept with the port. The default counts until settings have been read.
    type Speech: Copy + Default;
    /// A line on its way to its answer.
    type Request: Answers;
    /// A notice on its way out.
    type Telling: Tells;
    /// What is kept between reports.
    type Memory: Remembers;

    /// Whether lines are answered in their order, empty ones too, and `?` and bytes above 0x7F are taken out of lines wherever they stand.
    const IN_ORDER: bool = false;

    /// Whether a printing host speaks so: `!`, `~`, `%` and bytes above 0x7F are text wherever they stand, blocks are [rewritten](Dialect::rewrite), and only
    /// lines that are control lines in this dialect overtake.
    const IS_PLAIN: bool = false;

    /// Whether the settings have a port begin in this dialect. If no dialect is chosen they begin in the first of the table.
    fn is_chosen(settings: &Settings, port: u8) -> bool {
        let _ = (settings, port);
        false
    }

    /// Whether a line is said in this dialect alone, so that it decides for a port that waits for that.
    fn is_decided_by(line: &[u8]) -> bool;

    /// The words of a jog, if a block is one: G-code that moves and changes no mode.
    fn jog(block: &[u8]) -> Option<&[u8]> {
        let _ = block;
        None
    }

    /// How ports are spoken to after a start.
    fn speech(settings: &Settings) -> Self::Speech;

    /// Begins with a line, of which the sender counts `length` bytes. `None` if there is nothing to answer. The line decides how the
    /// port is spoken to from now on.
    fn begin(
        line: &[u8],
        length: u16,
        speech: &mut Self::Speech,
        settings: &Settings,
    ) -> Option<Self::Request>;

    /// The answer to a `?` alone, where such bytes are taken out of lines: a status report.
    fn question() -> Option<Self::Request> {
        None
    }

    /// Answers a line that could not be kept with a status; `line` is what is left of it.
    fn refuse(
        status: Status,
        line: &[u8],
        length: u16,
        speech: &mut Self::Speech,
        settings: &Settings,
    ) -> Self::Request;

    /// A block of a [plain](Dialect::IS_PLAIN) dialect in the words of the interpreter.
    fn rewrite<'a>(block: &[u8], out: &'a mut Rewritten) -> Result<&'a [u8], Status> {
        out.clear();
        out.extend_from_slice(block).map_err(|_| Status::InputTooLong)?;
        Ok(out)
    }

    /// A count of the lines that have been begun, if a line that takes long is told so: [`Notice::Busy`].
    fn activity(speech: Self::Speech) -> Option<u8> {
        let _ = speech;
        None
    }

    /// Seconds from one [`Notice::Temperatures`] to the next; 0 for none.
    fn interval_s(memory: &Self::Memory) -> u8 {
        let _ = memory;
        0
    }

    /// Begins to tell what is so by now.
    fn tell(notice: Notice, speech: Self::Speech, machine: &mut impl Machine) -> Self::Telling;

    /// Whether blocks of G-code that are carried out, and have no comment, are answered by [`Dialect::put_brief`]: `Some(true)` all,
    /// `Some(false)` those without a line number, `None` none. Asked before each line: a few cycles.
    fn brief(speech: Self::Speech, settings: &Settings) -> Option<bool>;

    /// The block of a line that is as most lines of a [plain](Dialect::IS_PLAIN) dialect are, and takes its place in the order. `None`, and nothing done,
    /// for one that has to be looked at closer. If the block is a usual move, it is answered by [`Dialect::put_brief`].
    #[inline(always)]
    fn fast_path(line: &[u8], speech: &mut Self::Speech) -> Option<Span> {
        let _ = (line, speech);
        None
    }

    /// Puts the whole answer to such a block. Called for each usual move: part of its budget.
    fn put_brief(settings: &Settings, ending: Ending, out: &mut impl Out);

    /// Puts the end of a line.
    fn put_line_end(settings: &Settings, out: &mut impl Out);

    /// Whether empty lines are answered.
    fn answers_empty(speech: Self::Speech) -> bool;

    /// Whether a [control line](Dialect::is_control) may begin so.
    fn may_be_control(first: u8) -> bool;

    /// Whether a line is a control line, which overtakes G-code that waits.
    fn is_control(line: &[u8]) -> bool;

    /// The alarm that a line of at most [`STOP_MAX`](super::STOP_MAX) bytes begins when it arrives, before it is answered.
    fn asks_alarm(line: &[u8]) -> Option<Alarm>;
}

/// A line that is being answered. No answer begins before the G-code of its line has run.
pub trait Answers {
    /// The G-code that the next step would ask for with [`Next::Gcode`], if that is so already.
    fn gcode(&self) -> Option<Span>;

    /// Takes the status with which that G-code has run, and whether it may have a `comment`.
    fn ran(&mut self, status: Status, comment: bool);

    /// Does the next bit of work and puts at most [`CHUNK`](super::CHUNK) bytes. The line is handed in anew each time.
    fn step(&mut self, line: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Next;

    /// Whether something of the answer has been put.
    fn has_begun(&self) -> bool;

    /// A status report comes before what is next, if no line of the answer is open. Whether it does.
    fn interject(&mut self) -> bool {
        false
    }

    /// Nothing more is put than what the line tells: it comes from a file, whose sender waits for no answer.
    fn silence(&mut self) {}

    /// Whether the answer is a list, in which a `?` is not to wait for what has been put.
    fn is_list(&self) -> bool {
        false
    }

    /// Whether what is next is done at rest. Until then the line waits as G-code does, and others overtake it.
    fn awaits_rest(&self) -> bool {
        false
    }
}

/// A notice that is being told.
pub trait Tells {
    /// Puts the next part, at most [`CHUNK`](super::CHUNK) bytes. Whether there is more.
    fn step(&mut self, machine: &mut impl Machine, out: &mut impl Out) -> bool;

    /// Ends the line here, so that an answer can be sent: the rest follows in a line of its own. False if a line of it can't end here.
    fn split(&mut self, out: &mut impl Out) -> bool {
        let _ = out;
        false
    }

    /// How many free blocks a queue report has told.
    fn blocks_free(&self) -> usize {
        0
    }
}

/// What is kept between reports.
pub trait Remembers {
    /// At first. [`Remembers::restore`] comes when it is in its place, for there is little stack where it is made.
    fn new() -> Self;

    /// Settings have their defaults, and so has what reports hold.
    fn restore(&mut self);

    /// The next report tells everything, for its reader has been told nothing so far.
    fn refresh(&mut self);
}

macro_rules! dialects {
    ($($(#[$what:meta])* $field:ident: $name:ident($dialect:ty) if $feature:literal;)+) => {
        #[cfg(not(any($(feature = $feature),+)))]
        compile_error!("an image needs a dialect: one of the features `dialect-...`");

        /// How a port is spoken to: in which dialect, and what that keeps.
        #[derive(Clone, Copy)]
        pub enum Speech {
            $($(#[$what])* #[cfg(feature = $feature)] $name(<$dialect as Dialect>::Speech),)+
        }

        /// A line on its way to its answer.
        pub enum Request {
            $($(#[$what])* #[cfg(feature = $feature)] $name(<$dialect as Dialect>::Request),)+
        }

        /// A notice on its way out.
        pub enum Telling {
            $($(#[$what])* #[cfg(feature = $feature)] $name(<$dialect as Dialect>::Telling),)+
        }

        /// What the dialects keep between reports.
        pub struct Memory {
            $($(#[$what])* #[cfg(feature = $feature)] pub $field: <$dialect as Dialect>::Memory,)+
        }

        impl Default for Speech {
            /// In the first dialect of the table that is built in.
            #[allow(unreachable_code)]
            fn default() -> Self {
                $(#[cfg(feature = $feature)]
                { return Self::$name(Default::default()); })+
            }
        }

        impl Speech {
            /// Whether the image has several dialects, of which a sender may choose.
            pub const IS_CHOSEN: bool = 1 < 0 $(+ cfg!(feature = $feature) as usize)+;

            /// How a port is spoken to after a start: in the dialect that is chosen, else in the first of the table that is built in.
            #[allow(unreachable_code)]
            #[inline(always)]
            pub fn at_start(settings: &Settings, port: u8) -> Self {
                $(#[cfg(feature = $feature)]
                if <$dialect>::is_chosen(settings, port) {
                    return Self::$name(<$dialect>::speech(settings));
                })+
                $(#[cfg(feature = $feature)]
                { return Self::$name(<$dialect>::speech(settings)); })+
            }

            /// The dialect that a line decides for, if it is said in one alone; see [`Dialect::is_decided_by`].
            #[small]
            pub fn decided_by(line: &[u8], settings: &Settings) -> Option<Self> {
                $(#[cfg(feature = $feature)]
                if <$dialect>::is_decided_by(line) {
                    return Some(Self::$name(<$dialect>::speech(settings)));
                })+
                None
            }

            /// The dialect whose senders ask by a `?` alone, if it is built in.
            #[small]
            pub fn of_question(settings: &Settings) -> Option<Self> {
                $(#[cfg(feature = $feature)]
                if <$dialect>::IN_ORDER {
                    return Some(Self::$name(<$dialect>::speech(settings)));
                })+
                None
            }

            /// The greeting that an undecided port tells beside that of its dialect: of the dialect whose senders ask by a `?`, else of
            /// printing hosts.
            #[small]
            pub fn of_other_greeting(settings: &Settings) -> Option<Self> {
                let mut other = Self::of_question(settings);
                $(#[cfg(feature = $feature)]
                if <$dialect>::IS_PLAIN && other.is_none() {
                    other = Some(Self::$name(<$dialect>::speech(settings)));
                })+
                other
            }

            /// Whether an image has a dialect whose senders ask by a `?` alone.
            pub const HAS_QUESTION: bool = {
                let mut has = false;
                $(#[cfg(feature = $feature)]
                { has |= <$dialect>::IN_ORDER; })+
                has
            };

            /// Whether an image has a dialect that is [plain](Dialect::IS_PLAIN).
            pub const HAS_PLAIN: bool = {
                let mut has = false;
                $(#[cfg(feature = $feature)]
                { has |= <$dialect>::IS_PLAIN; })+
                has
            };

            /// In the same dialect, as after a start.
            #[cfg(feature = "sd")]
            pub fn fresh(self, settings: &Settings) -> Self {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(_) => Self::$name(<$dialect>::speech(settings)),)+
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

            /// See [`Dialect::interval_s`].
            #[inline(always)]
            pub fn interval_s(self, memory: &Memory) -> u8 {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(_) => <$dialect>::interval_s(&memory.$field),)+
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
            fn silence(&mut self) {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(request) => request.silence(),)+
                }
            }

            #[inline(always)]
            fn awaits_rest(&self) -> bool {
                match self {
                    $(#[cfg(feature = $feature)]
                    Self::$name(request) => request.awaits_rest(),)+
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

        /// See [`Dialect::jog`]: in any dialect that is built in.
        #[inline(always)]
        pub fn jog(block: &[u8]) -> Option<&[u8]> {
            let mut words = None;
            $(#[cfg(feature = $feature)]
            { words = words.or_else(|| <$dialect>::jog(block)); })+
            words
        }

        /// See [`Dialect::may_be_control`]: in any dialect that is built in.
        #[inline(always)]
        pub fn may_be_control(first: u8) -> bool {
            let mut may = false;
            $(#[cfg(feature = $feature)]
            { may |= <$dialect>::may_be_control(first); })+
            may
        }

        /// See [`Dialect::is_control`]: in any dialect that is built in and is `plain`, or is not.
        #[inline(always)]
        pub fn is_control(line: &[u8], plain: bool) -> bool {
            let mut is = false;
            $(#[cfg(feature = $feature)]
            { is = is || (<$dialect>::IS_PLAIN == plain && <$dialect>::is_control(line)); })+
            is
        }

        /// See [`Dialect::asks_alarm`]: in any dialect that is built in and is `plain`, or is not.
        #[inline(always)]
        pub fn asks_alarm(line: &[u8], plain: bool) -> Option<Alarm> {
            let mut alarm = None;
            $(#[cfg(feature = $feature)]
            if <$dialect>::IS_PLAIN == plain {
                alarm = alarm.or_else(|| <$dialect>::asks_alarm(line));
            })+
            alarm
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
