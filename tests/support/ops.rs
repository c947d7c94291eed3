//! What a sender may do, and what may happen to the machine meanwhile: random, of a size that the machine under test
//! can bear.

use kerf::boards::inputs::{DOOR, PROBE, STOP, Y_MIN};
use proptest::prelude::*;
use proptest::sample::select;

/// One action of a conversation.
#[derive(Clone, Debug)]
pub enum Op {
    /// A line on a port.
    Line(usize, String),
    /// Bytes between lines on a port.
    Characters(usize, &'static [u8]),
    /// Real-time characters within a line on the first port.
    Within(&'static str, &'static [u8], &'static str),
    /// The contact at an input closes, or opens.
    Input(usize, bool),
    /// The second port's sender holds the machine back (true) or lets it go on.
    Hold(bool),
    /// Time passes, ms.
    Wait(u64),
    /// The sender waits until the machine is at rest, and asks for its position.
    Rest,
    /// `^x` within a line.
    Reset,
}

/// The size of a conversation.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// Most actions.
    pub ops: usize,
    /// Longest move of an axis, in 0.001 mm.
    pub way: i32,
    /// Radius of an arc of three turns, mm.
    pub radius: f64,
    /// Longest wait, ms.
    pub wait: u64,
}

/// Inputs that are actuated by hand: no axis has a switch there.
pub const BY_HAND: [usize; 4] = [Y_MIN, PROBE, DOOR, STOP];

/// A conversation.
pub fn conversation(scale: Scale) -> impl Strategy<Value = Vec<Op>> {
    prop::collection::vec(op(scale), 1..=scale.ops)
}

fn op(scale: Scale) -> impl Strategy<Value = Op> {
    prop_oneof![
        30 => line(scale).prop_map(|line| Op::Line(0, line)),
        20 => select(CHARACTERS).prop_map(|characters| Op::Characters(0, characters)),
        20 => prop_oneof![0..scale.wait / 50, 0..scale.wait].prop_map(Op::Wait),
        3 => (select(HALVES), select(CHARACTERS)).prop_map(|((a, b), c)| Op::Within(a, c, b)),
        3 => select(ASIDE).prop_map(|line| Op::Line(1, line.to_string())),
        2 => select(CHARACTERS).prop_map(|characters| Op::Characters(1, characters)),
        1 => any::<bool>().prop_map(Op::Hold),
        4 => (select(&BY_HAND[..]), any::<bool>()).prop_map(|(input, closed)| Op::Input(input, closed)),
        3 => Just(Op::Rest),
        1 => Just(Op::Reset),
    ]
}

/// Real-time characters, some with the end of a line. The last ones are overrides: feed 100 %, +10, -10; traverse 25
/// %.
const CHARACTERS: &[&[u8]] = &[
    b"!",
    b"!",
    b"~",
    b"~",
    b"%",
    b"%\n",
    b"!\n%\n",
    b"!%",
    b"%!",
    b"!%~",
    b"!~",
    b"~!",
    b"\x04",
    b"\x04%\n",
    b"\x05",
    b"\x90",
    b"\x91\x91!",
    b"\x92~",
    b"\x97",
    // The end of a jog.
    b"\x85",
    b"\x85~",
];

/// Lines in two halves, for real-time characters between the halves.
const HALVES: &[(&str, &str)] = &[
    ("g91 g0 x", "0.5"),
    ("{pos", "x:n}"),
    ("g90 g0 x1 (a com", "ment) y1"),
    ("", "g91 g1 f3000 x0.2"),
    ("m3 s500", ""),
];

/// Lines on the second port.
const ASIDE: &[&str] = &[
    "{stat:n}",
    "{stat:n}",
    "g91 g1 f3000 x0.3",
    "g91 g0 z-0.2",
    "{jogy:1}",
    "{gc:\"g91 g0 y0.5\"}",
    "{qf:1}",
    "{clear:1}",
    "g91 g38.3 f3000 z-1",
];

/// Lines that may come at any time.
const ANY_LINE: &[&str] = &[
    // Lines that stop, end, or wait.
    "m0",
    "m2",
    "{qf:1}",
    "{alarm:1}",
    "{clear:1}",
    "{clear:1}",
    "{clear:1}",
    "{shutd:1}",
    "g4 p0.1",
    "g4 p0.02",
    "g4 p0",
    // Spindle and coolant.
    "m3 s100",
    "m4 s2000",
    "s1500",
    "m5",
    "m8",
    "m7",
    "m9",
    "g91 g1 f3000 x0.2 m3 s300",
    // Overrides.
    "{mfo:0.3}",
    "{mfo:2}",
    "{mto:0.2}",
    "{sso:0.5}",
    "m50 p0.6",
    "m48",
    "m49",
    // Questions.
    "{posx:n}",
    "{sr:n}",
    "{stat:n,vel:n}",
    // Lines that are refused.
    "g1 f3000 x",
    "{none:1}",
    "{jogx:300000}",
    // Settings of what a switch is for, with some time in which they are stored.
    "{xsn:3}",
    "{xsn:1}",
    "{ysn:3}",
    "{ysn:1}",
    "{saf:1}",
    "{saf:1}",
    "{saf:0}",
    "{est:1}",
    "{est:0}",
    "{xjm:4000}",
    // Coordinate systems and offsets.
    "g54",
    "g55",
    "g10 l20 p2 x0.5",
    "g92 x1 y-0.5",
    "g92.1",
    "g28.3 x0 y0 z0",
    "g28.2 x0",
    "g28.2 x0",
    "g28.2 z0 x0",
    "g28.2 z0",
    "g28.2 y0",
    "g28.4 x0",
    "{home:1}",
];

fn line(scale: Scale) -> impl Strategy<Value = String> {
    let way = move || (-scale.way..scale.way).prop_map(|n| f64::from(n) * 1e-3);
    let radius = scale.radius;
    prop_oneof![
        8 => (way(), way()).prop_map(|(x, y)| format!("g91 g1 f3000 x{x} y{y}")),
        4 => (way(), way(), way()).prop_map(|(x, y, z)| format!("g90 g0 x{x} y{y} z{z}")),
        1 => way().prop_map(|z| format!("g91 g1 f3000 z{z} a9")),
        // More chords than the queue has blocks.
        2 => Just(format!("g91 g2 f3000 x0 i{radius} j0.3 p3")),
        1 => Just("g91 g81 f600 x0.5 y0.5 z-0.5 r0 l3".to_string()),
        1 => way().prop_map(|x| format!("{{\"gc\":\"g91 g1 f3000 x{x}\"}}")),
        2 => (select(&["38.2", "38.3", "38.4", "38.5"][..]), way())
            .prop_map(|(code, z)| format!("g91 g{code} f3000 x0.2 z{z}")),
        2 => (select(&["x", "y", "z"][..]), way()).prop_map(|(axis, to)| format!("{{jog{axis}:{to}}}")),
        1 => way().prop_map(|x| format!("{{\"jog\":{{\"x\":{x}}}}}")),
        14 => select(ANY_LINE).prop_map(str::to_string),
    ]
}
