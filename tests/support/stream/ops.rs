//! The random actions of a conversation of two streams.

use proptest::prelude::*;
use proptest::sample::select;

use super::lines::{End, Template, What};

/// How a sender knows how much it may send.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Count {
    /// It has up to four lines without answers.
    Lines,
    /// It has up to a number of characters without answers.
    Characters,
    /// It sends as long as the machine does not stop it, by characters or pins.
    Flow,
}

/// How the machine and its senders are set up.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The port that most of the G-code comes from.
    pub main: usize,
    pub counts: [Count; 2],
    /// Bytes that are kept free for questions and real-time characters.
    pub margin: usize,
    /// Bytes that a sender still sends after it has been stopped.
    pub late: usize,
    pub ex: u8,
    pub rxm: u8,
    pub sv: u8,
    pub ec: u8,
    pub jv: u8,
    /// How long before its wrap the count of milliseconds begins, if each conversation has a machine of its own.
    #[allow(dead_code)]
    pub wrap: u16,
}

/// One action of a conversation.
#[derive(Clone, Debug)]
pub enum Op {
    /// Lines for the stream of the main port (true) or of the other.
    Feed(bool, Vec<Template>),
    /// Characters in the stream of a port, after this many more bytes of the stream.
    Characters(usize, &'static [u8], u8),
    /// The sender of a port stops the machine's answers (true) or lets them come.
    Hold(usize, bool),
    /// A question, between two lines.
    Ask(usize),
    /// Time passes, ms.
    Wait(u16),
    /// Waits until all lines are answered and the machine is at rest.
    Rest,
}

/// The size of a conversation.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// Most actions, and most lines of an action.
    pub ops: usize,
    pub lines: usize,
    /// Longest wait, ms.
    pub wait: u16,
    /// Longest time before the wrap, ms; 0 for no wrap.
    pub wrap: u16,
}

/// A conversation.
pub fn conversation(scale: Scale) -> impl Strategy<Value = (Setup, Vec<Op>)> {
    (setup(scale), prop::collection::vec(op(scale), 1..=scale.ops))
}

fn setup(scale: Scale) -> impl Strategy<Value = Setup> {
    let count = || select(&[Count::Lines, Count::Characters, Count::Flow][..]);
    let senders = (0..2usize, [count(), count()], select(&[0, 20, 60][..]), 0..16usize);
    let modes = (0..3u8, 0..2u8, 0..3u8, 0..2u8, 4..6u8, 0..=scale.wrap);
    (senders, modes).prop_map(|((main, counts, margin, late), (ex, rxm, sv, ec, jv, wrap))| Setup {
        main,
        counts,
        margin,
        late,
        ex,
        rxm,
        sv,
        ec,
        jv,
        wrap,
    })
}

fn op(scale: Scale) -> impl Strategy<Value = Op> {
    let lines = prop::collection::vec(template(), 1..=scale.lines);
    prop_oneof![
        12 => (prop::bool::weighted(0.8), lines).prop_map(|(main, lines)| Op::Feed(main, lines)),
        12 => (0..2usize, select(CHARACTERS), any::<u8>())
            .prop_map(|(port, characters, after)| Op::Characters(port, characters, after)),
        6 => (0..2usize, any::<bool>()).prop_map(|(port, holds)| Op::Hold(port, holds)),
        8 => (0..2usize).prop_map(Op::Ask),
        12 => prop_oneof![0..40u16, 0..scale.wait].prop_map(Op::Wait),
        2 => Just(Op::Rest),
    ]
}

/// Real-time characters. The last ones are overrides.
const CHARACTERS: &[&[u8]] = &[
    b"!", b"!", b"!", b"~", b"~", b"~", b"%", b"!%", b"%!", b"!~", b"~!", b"!%~", b"\x04", b"\x04",
    b"!\x04", b"\x05", b"\x85", b"\x91", b"\x90", b"\x97", b"\x95",
];

fn template() -> impl Strategy<Value = Template> {
    let len = prop_oneof![
        6 => Just(0),
        2 => 0..80u8,
        1 => 240..=254u8,
        1 => 0..=254u8,
    ];
    let end = prop_oneof![
        6 => Just(End::Feed),
        1 => Just(End::Return),
        1 => Just(End::Both),
        1 => Just(End::Empty),
    ];
    let lead = prop_oneof![6 => Just(0), 1 => 0..4u8];
    (what(), len, lead, end).prop_map(|(what, len, lead, end)| Template { what, len, lead, end })
}

/// Pairs to read, with short answers and long ones.
const READ: &[&str] = &[
    "xvm:n",
    "posx:n",
    "fb:n",
    "x:n",
    "sys:n",
    "sr:n",
    "1:n",
    "pos:n,mpo:n,ofs:n",
    "rx:n",
    "kept:n",
    "txt:\"$x\"",
    "txt:\"$g54\"",
    "txt:\"?\"",
    "none:n",
    "xvm:n,xfr:n,xac:n,xjm:n",
    "qr:n",
];

/// Blocks that move nothing.
const BLOCKS: &[&str] = &[
    "(c)",
    "m0",
    "m1",
    "m2",
    "m3 s500",
    "m4 s900",
    "m5",
    "m8",
    "m9",
    "g54",
    "g55",
    "g61",
    "g61.1",
    "g64",
    "g64 p0",
    "g64 p0.01",
    "g64 p0.3",
    "g92.1",
    "t1",
    "g10 l2 p3 x1",
    "g10 l2 p4 x2 y1",
];

fn what() -> impl Strategy<Value = What> {
    let way = || prop_oneof![-8..0i8, 1..9i8];
    let feed = || select(&[60u16, 600, 3_000, 3_000, 0][..]);
    prop_oneof![
        24 => (way(), feed()).prop_map(|(way, feed)| What::Move(way, feed)),
        4 => (way(), feed(), any::<bool>()).prop_map(|(way, feed, tid)| What::Wrapped(way, feed, tid)),
        3 => (0..200u16).prop_map(What::Dwell),
        6 => select(BLOCKS).prop_map(What::Block),
        8 => select(READ).prop_map(What::Read),
        4 => Just(What::Ask),
        3 => any::<u16>().prop_map(What::Set),
        3 => Just(What::Get),
        1 => Just(What::Flush),
        1 => prop_oneof![Just(What::Alarm), Just(What::Clear), Just(What::Clear)],
        1 => any::<u8>().prop_map(What::TooLong),
    ]
}
