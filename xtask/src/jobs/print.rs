//! A small print, written like the output of a slicer: a ring of 20 mm, three layers high.

use std::f64::consts::PI;
use std::fmt::Write;

use super::program::{Point, on_circle};

const CENTRE: Point = (60.0, 60.0);
const OUTER: f64 = 10.0;
const INNER: f64 = 6.0;
const LAYERS: u32 = 3;
const HEIGHT: f64 = 0.2;
const WIDTH: f64 = 0.45;
/// Diameter of the filament, mm.
const FILAMENT: f64 = 1.75;
/// Length of the straight pieces of a circle, mm.
const CHORD: f64 = 0.5;
/// Distance of the infill lines, mm.
const FILL: f64 = 1.5;
/// Length by which the filament is retracted for travels, mm, and the length of a travel from which on it is
/// retracted.
const RETRACTION: f64 = 0.8;
const FAR: f64 = 2.0;

/// Feeds, mm/min.
const TRAVEL: u32 = 7_800;
const FIRST: u32 = 1_200;
const PERIMETER: u32 = 2_700;
const FILLING: u32 = 3_600;
const RETRACT: u32 = 2_100;

const START: &str = "\
M140 S60 ; bed
M104 S200 ; hot end
M190 S60 ; wait for the bed
M109 S200 ; wait for the hot end
G28 ; home all axes
G1 Z5 F600 ; lift the nozzle
G21 ; millimetres
G90 ; absolute coordinates
M82 ; absolute distances of the extruder
G92 E0
M107
";

const END: &str = "\
G92 E0
G1 E-2 F2100
M107
M104 S0 ; hot end off
M140 S0 ; bed off
G91
G1 Z5 F600
G90
G1 X5 Y100 F6000 ; show the print
M84 ; motors off
";

/// Returns the text of the file.
pub fn job() -> String {
    let mut print = Print::default();
    print.text.push_str("; A ring of 20 mm, three layers of 0.2 mm, as a slicer writes it\n");
    print.text.push_str(START);
    for layer in 0..LAYERS {
        print.layer(layer);
    }
    print.text.push_str(END);
    print.text
}

#[derive(Default)]
struct Print {
    text: String,
    at: Point,
    /// Length of filament since the layer began.
    e: f64,
    feed: u32,
}

impl Print {
    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn layer(&mut self, layer: u32) {
        let z = HEIGHT * f64::from(layer + 1);
        self.line(&format!(";LAYER:{layer}"));
        self.line("G92 E0");
        self.e = 0.0;
        self.line(&format!("G1 Z{z:.3} F600"));
        if layer == 1 {
            self.line("M106 S255");
        }
        let feed = |usual| if layer == 0 { FIRST } else { usual };
        if layer == 0 {
            self.line(";TYPE:Skirt");
            self.circle(OUTER + 4.0, FIRST);
            self.circle(OUTER + 4.0 - WIDTH, FIRST);
        }
        self.line(";TYPE:Perimeter");
        let inset = |lines: f64| (lines + 0.5) * WIDTH;
        for radius in [INNER + inset(1.0), INNER + inset(0.0)] {
            self.circle(radius, feed(PERIMETER));
        }
        for radius in [OUTER - inset(1.0), OUTER - inset(0.0)] {
            self.circle(radius, feed(PERIMETER));
        }
        self.line(";TYPE:Fill");
        let angle = if layer.is_multiple_of(2) { 45.0 } else { 135.0 };
        for (from, to) in fill(angle, INNER + inset(1.5), OUTER - inset(1.5)) {
            self.travel(from);
            self.extrude(to, feed(FILLING));
        }
    }

    fn circle(&mut self, radius: f64, feed: u32) {
        let pieces = (2.0 * PI * radius / CHORD).ceil();
        self.travel(on_circle(CENTRE, radius, 0.0));
        let mut n = 0.0;
        while n < pieces {
            n += 1.0;
            self.extrude(on_circle(CENTRE, radius, 360.0 * n / pieces), feed);
        }
    }

    fn extrude(&mut self, to: Point, feed: u32) {
        let area = FILAMENT * FILAMENT * PI / 4.0;
        self.e += distance(self.at, to) * HEIGHT * WIDTH / area;
        let mut line = format!("G1 X{:.3} Y{:.3} E{:.5}", to.0, to.1, self.e);
        if feed != self.feed {
            let _ = write!(line, " F{feed}");
            self.feed = feed;
        }
        self.line(&line);
        self.at = to;
    }

    fn travel(&mut self, to: Point) {
        let pulls = distance(self.at, to) >= FAR;
        if pulls {
            self.line(&format!("G1 E{:.5} F{RETRACT}", self.e - RETRACTION));
        }
        self.line(&format!("G0 X{:.3} Y{:.3} F{TRAVEL}", to.0, to.1));
        if pulls {
            self.line(&format!("G1 E{:.5} F{RETRACT}", self.e));
        }
        (self.at, self.feed) = (to, 0);
    }
}

fn distance(a: Point, b: Point) -> f64 {
    (a.0 - b.0).hypot(a.1 - b.1)
}

/// Parallel lines between two circles, to and fro.
fn fill(degrees: f64, inner: f64, outer: f64) -> Vec<(Point, Point)> {
    let (sin, cos) = (degrees * PI / 180.0).sin_cos();
    let place = |off: f64, along: f64| {
        (CENTRE.0 + along * cos - off * sin, CENTRE.1 + along * sin + off * cos)
    };
    let mut lines = Vec::new();
    let mut off = FILL / 2.0 - outer;
    let mut forth = true;
    while off < outer {
        let far = (outer * outer - off * off).sqrt();
        let near = (inner * inner - off * off).max(0.0).sqrt();
        let mut spans =
            if near > 0.0 { vec![(-far, -near), (near, far)] } else { vec![(-far, far)] };
        if !forth {
            spans.reverse();
            spans.iter_mut().for_each(|(from, to)| std::mem::swap(from, to));
        }
        lines.extend(spans.into_iter().map(|(from, to)| (place(off, from), place(off, to))));
        (off, forth) = (off + FILL, !forth);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_heats_before_it_extrudes_and_ends_cold() {
        let job = job();
        let at = |text: &str| job.find(text).unwrap_or_else(|| panic!("no {text}"));
        assert!(at("M109 S200") < at("G28") && at("G28") < at("G1 X"));
        assert!(at("M104 S0") > job.rfind("G1 X7").unwrap_or(0));
        assert!((600..2_000).contains(&job.lines().count()), "{} lines", job.lines().count());
    }

    #[test]
    fn filament_is_that_of_the_lines() {
        let lengths = job();
        let layers: Vec<_> = lengths.split(";LAYER:").skip(1).collect();
        assert_eq!(layers.len(), 3);
        for layer in layers {
            let words = layer.split(['\n', ' ']).filter_map(|word| word.strip_prefix('E'));
            let most = words.filter_map(|e| e.parse::<f64>().ok()).fold(0.0, f64::max);
            assert!((5.0..20.0).contains(&most), "{most} mm");
        }
    }
}
