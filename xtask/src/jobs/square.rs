//! The first job to try: a square.

use super::program::Program;

/// A 20 mm square, one pass.
pub fn job() -> String {
    let mut p = Program::new("A 20 mm square, 1 mm deep");
    p.rapid_z(2.0);
    p.rapid((10.0, 10.0));
    p.note("down, around, up");
    p.plunge(-1.0, 300.0);
    p.cut_at((30.0, 10.0), 600.0);
    p.cut((30.0, 30.0));
    p.cut((10.0, 30.0));
    p.cut((10.0, 10.0));
    p.rapid_z(2.0);
    p.rapid((0.0, 0.0));
    p.line("M2");
    p.numbered()
}
