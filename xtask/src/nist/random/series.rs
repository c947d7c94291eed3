//! Series of canned cycles.

use super::{PLANES, Program, offset};

impl Program {
    /// Adds canned cycles that begin above R, which falls from line to line.
    pub(super) fn series(&mut self) {
        let depth = PLANES[self.plane][2];
        self.distance(false);
        let level = self.value(60, 80);
        self.say(&format!("G0 {depth}{level}"));
        self.say("M3 S100");
        let incremental = self.dice.below(3) == 0;
        self.distance(incremental);
        // The interpreters read G91 with G99, and G85 with G98, differently.
        let to_r = !incremental && self.dice.below(2) == 0;
        self.say(if to_r { "G99" } else { "G98" });
        let mut retract = 40;
        for _ in 0..=self.dice.below(3) {
            retract -= self.dice.below(8) as i32;
            self.cycle(retract, incremental, to_r);
        }
        let end = self.dice.of(&["G80", "G0", "G80"]);
        self.say(end);
        self.straight = end == "G0";
    }

    fn cycle(&mut self, retract: i32, incremental: bool, to_r: bool) {
        let [first, second, depth] = PLANES[self.plane];
        let codes: &[&str] = if to_r {
            &["G73 Q", "G81", "G82 P1.5", "G83 Q", "G85", "G86 P1", "G87", "G89 P1"]
        } else {
            &["G73 Q", "G81", "G82 P1.5", "G83 Q", "G86 P1", "G87", "G89 P1"]
        };
        let mut code = self.dice.of(codes).to_owned();
        if code.ends_with('Q') {
            // The peck is no divisor of a depth, because the other interpreter's sum of pecks may just miss the
            // bottom.
            code += self.dice.of(if self.inch { &["0.137", "0.171"] } else { &["3.37", "5.71"] });
        }
        if code == "G87" {
            // The value is above the bottom and below R, wherever it is counted from.
            let top = self.number(1_000);
            code += &offset(depth, &top);
            for axis in [first, second] {
                let aside = self.value(-3, 3);
                code += &offset(axis, &aside);
            }
        }
        let plane = self.some(&format!("{first}{second}"));
        let (retract, bottom) = if incremental { (retract - 60, -20) } else { (retract, 5) };
        let [retract, bottom] = [retract, bottom].map(|at| self.number(at * 100));
        let repeat = self.dice.of(&["", "", "L2", "L3"]);
        self.say(&format!("{code} {plane} R{retract} {depth}{bottom} {repeat}"));
        for _ in 0..self.dice.below(3) {
            let plane = self.some(&format!("{first}{second}"));
            let between = self.dice.of(&["", "", "", "F90", "S200", "G4 P1"]);
            self.say(&format!("{plane} {between}"));
        }
    }
}
