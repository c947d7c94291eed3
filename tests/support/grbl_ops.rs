//! What a sender in grbl's dialect may do, and what may come in between: random, of a size that the machine under
//! test can bear.

use proptest::prelude::*;
use proptest::sample::select;

/// One action of a conversation.
#[derive(Clone, Debug)]
pub enum Op {
    /// A line. Real-time bytes are inserted before the bytes at these places.
    Line(String, Vec<(usize, u8)>),
    /// Real-time bytes between lines.
    Bytes(Vec<u8>),
    /// A line in TinyG's dialect on the second port.
    Aside(&'static str),
    /// Time passes, ms.
    Wait(u64),
    /// The sender waits until the machine is at rest, and checks its position.
    Rest,
    /// `^x`, after a line without its end.
    Reset,
}

/// A conversation of at most `ops` actions, with waits of at most `wait` ms.
pub fn conversation(ops: usize, wait: u64) -> impl Strategy<Value = Vec<Op>> {
    prop::collection::vec(op(wait), 1..=ops)
}

fn op(wait: u64) -> impl Strategy<Value = Op> {
    prop_oneof![
        40 => (line(), within()).prop_map(|(line, within)| Op::Line(line, within)),
        15 => prop::collection::vec(select(ACTS), 1..4).prop_map(Op::Bytes),
        20 => prop_oneof![0..wait / 20, 0..wait].prop_map(Op::Wait),
        5 => select(ASIDE).prop_map(Op::Aside),
        3 => Just(Op::Rest),
        2 => Just(Op::Reset),
    ]
}

/// Real-time bytes at places within a line.
fn within() -> impl Strategy<Value = Vec<(usize, u8)>> {
    prop_oneof![
        3 => Just(Vec::new()),
        1 => prop::collection::vec((0..30_usize, select(ACTS)), 1..3),
    ]
}

/// Real-time bytes, and some bytes above 0x7F that do nothing.
const ACTS: &[u8] = &[
    b'?', b'?', b'?', b'?', b'!', b'~', b'~', 0x84, 0x85, 0x90, 0x91, 0x92, 0x93, 0x94, 0x95, 0x96,
    0x97, 0x99, 0x9A, 0x9B, 0x9C, 0x9D, 0x9E, 0xA0, 0xA1, 0x80, 0xC2, 0xFF,
];

/// Lines on the second port.
const ASIDE: &[&str] =
    &["{stat:n}", "{posx:n,vel:n}", "{xvm:n}", "g91 g0 y0.2", "{\"sr\":null}", "{sys:n}"];

/// Lines that may come at any time, including lines that are refused.
const ANY: &[&str] = &[
    "",
    "  ",
    "(a comment)",
    "; another",
    "%",
    "$",
    "$$",
    "$#",
    "$G",
    "$G",
    "$I",
    "$N",
    "$X",
    "$C",
    "$C",
    "$10=3",
    "$11=0.01",
    "$110=3000",
    "$100=0",
    "$999=1",
    "$",
    "$Q",
    "$J=",
    "$J=X1",
    "$J=G91X0.3F3000",
    "$J=G91X-0.4Y0.2F100000",
    "$J=G91Z-0.1F3000",
    "$J=G2X1F100",
    "$SLP",
    "$H",
    "$N0=G54",
    "$N1=",
    "M0",
    "M2",
    "M30",
    "M3S1000",
    "M4S200",
    "M5",
    "M7",
    "M8",
    "M9",
    "S500",
    "T1",
    "G4P0.05",
    "G4P0",
    "G4",
    "G54",
    "G55",
    "G10L20P1X0",
    "G10L2P2X0.1",
    "G92Y0",
    "G92.1",
    "G28.1",
    "G43.1Z0.1",
    "G49",
    "G17",
    "G18",
    "G19",
    "G20",
    "G21",
    "G90",
    "G93",
    "G94",
    "G1X",
    "G1XF",
    "X1X2",
    "G1G0X1",
    "G99.9",
    "M99",
    "N12G21",
    "N-1G21",
    "G38.3Z-0.2F600",
    "G2X1F100",
    "g91g1x0.1f3000m3s300",
    "g80",
    "/g91g0x5",
    "G53G0X0",
    "G0.5",
    "A",
    "G91G81X0.2Z-0.2R0.1F600",
    "G95",
    "[xvm:n]",
    "garbage",
];

fn line() -> impl Strategy<Value = String> {
    let way = || (-1500..1500_i32).prop_map(|n| f64::from(n) * 1e-3);
    prop_oneof![
        // The distance of these moves is counted.
        10 => way().prop_map(|x| format!("G21G94G91G1F3000X{x}")),
        4 => (way(), way()).prop_map(|(x, y)| format!("G90 G0 X{x} Y{y} (go)")),
        2 => way().prop_map(|x| format!("N7 G91 G3 F3000 X{x} R2")),
        12 => select(ANY).prop_map(str::to_string),
    ]
}
