//! The built-in jobs, by number: those of TinyG's jobs that a machine can run.

use super::Piece;
use crate::capability::Capability;
use crate::plain;
use crate::progmem;

macro_rules! pieces {
    ($count:literal: $($number:literal: $times:literal x $text:literal)+) => {
        progmem! {
            /// Each piece with the number of its job. The pieces of a job are adjacent.
            static PIECES: [(u8, Piece); $count] = [
                $(($number, Piece { text: plain!($text), times: $times })),+
            ];
        }
    };
}

pieces!(27:
    1: 1 x "(MSG smoke)\nG0 G17 G21 G40 G49 G80 G90 G94\nG92 X0 Y0 Z0 A0\nM3 G4 P1\nM5 G4 P1\nM4 G4 P1\nM5\nM7 G4 P1\nM8 G4 P1\nM9\n"
    1: 1 x "G0 X20\nY20\nZ5\nA20\nX0 Y0 Z0 A0\nX20 Y20\nX0 Y0\n"
    1: 1 x "G1 F30 X2 Y2 Z1 A2\nG0 X0 Y0 Z0 A0\nM2\n"
    2: 1 x "G28.2 X0 Y0 Z0\nM30\n"
    3: 1 x "(MSG squares)\nG21 G90 G17 G94 F400\nG92 X0 Y0 Z0\nG0 X20\nY20\nX0\nY0\nG1 X10\nY10\nX0\nY0\n"
    3: 1 x "G0 X20\nZ20\nX0\nZ0\nG1 X10\nZ10\nX0\nZ0\n"
    3: 1 x "G0 X20 Y20 Z20\nX0 Y0 Z0\nG1 X10 Y10 Z10\nX0 Y0 Z0\nG80\nM30\n"
    4: 1 x "(MSG arcs)\nG21 G90 G17 G94 F400\nG92 X0 Y0 Z0\nN1 G2 X10 Y-10 I10\nN2 G3 X0 Y0 J10\nN3 G2 X10 I5\nN4 G3 X0 I-5\n"
    4: 1 x "N5 G2 I10\nN6 I10\nN7 F600\nN8 I-10\nN9 G3 Z20 I10 P1\nN10 G2 Z0 I10 P1\n"
    4: 1 x "N11 G18 G2 X10 Z0 R8\nN12 G3 X0 Z0 R8\nG17 G80\nM30\n"
    5: 1 x "(MSG dwells)\nG21 G90 G55 F400\nG0 X0 Y0\nX10 G4 P1\nM3\nG4 P1\nY10\nM5\nG4 P1\nX0\n"
    5: 1 x "M8\nG4 P1\nY0\nM9\nG4 P1\nG54\nM30\n"
    6: 1 x "(MSG try hold and resume)\nG21 G90\nG92 X0 Y0\n"
    6: 1 x "G0 X100\nY100\nX0\nY0\nX100 Y100\nX0 Y0\nM30\n"
    7: 1 x "(MSG spindle and coolant)\nG21 G90 F400\nG92 X0 Y0\nM3\nG4 P.5\nM4\nG4 P.5\nM5\nG4 P.5\nM7\nG4 P.5\nM8\nG4 P.5\nM9\n"
    7: 1 x "M3 G1 X10\nM5 Y10\nM4 X0\nM5 Y0\nM8 G0 X10\nM9 X0\nM30\n"
    9: 1 x "(MSG inverse time)\nG21 G90 G93\nG92 X0 Y0 Z0\nG1 X10 F30\nY10 F30\nX0 F30\nY0 F30\nG2 I5 F10\nG3 Z5 I5 F10\nG1 Z0 F30\nG94\nM30\n"
    10: 1 x "(MSG rotary)\nG21 G90 G94 F36000\nG92 X0 Y0 A0 B0 C0\nG1 A360\nA0\nB360 C360\nB0 C0\nA1440\nA0\nX10 A360\nY10 A0\nX0 Y0 A360 B360\nA0 B0\nM30\n"
    11: 1 x "(MSG small moves)\nG21 G91 G94 F1000\n"
    11: 45 x "G1 X0.1 Y0.1\nX-0.1 Y-0.1\n"
    11: 1 x "G4 P.5\nX0.01\nY0.01\nX-0.01\nY-0.01\nX0.01 Y-0.01\nX-0.01 Y0.01\nG90\nM30\n"
    12: 1 x "(MSG slow moves)\nG21 G90 G55 G94 F22\nG0 X0 Y0\nG1 X10\nY10\nX0\nY0\nG54\nM30\n"
    13: 1 x "(MSG offsets)\nG21 G90\nG92 X10 Y10\nG0 X20 Y20\nX10 Y10\nG92.1\nG10 L2 P2 X50 Y50\nG55\nG0 X0 Y0\nX10\nY10\nX0\nY0\n"
    13: 1 x "G53 X0 Y0\nG53 X10\nG53 Y10\nG53 X0\nG53 Y0\nG54\nG10 L2 P2 X0 Y0\nM30\n"
    51: 1 x "(MSG braid)\nG21 G91 G94 F1200\nG1\n"
    51: 250 x "X.2 Y.1\nX.1 Y.2\nX-.1 Y.2\nX-.2 Y.1\nX-.2 Y-.1\nX-.1 Y-.2\nX.1 Y-.2\nX.2 Y-.1\nX.05\nX-.05\n"
    51: 1 x "G90\nM30\n"
);

/// Returns piece `index` of job `number`.
#[small]
pub fn piece(number: u8, index: u8) -> Option<Piece> {
    Capability::Jobs.check().ok()?;
    let of_job = |i| PIECES.at(i).filter(|(job, _)| *job == number);
    (0..PIECES.len()).filter_map(of_job).nth(index.into()).map(|(_, piece)| piece)
}
