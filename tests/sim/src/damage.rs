//! A wire between a printing host and the board that damages lines.
//!
//! One in `one_in` lines that have a line number is damaged at random: bytes are changed, lost or inserted. The end
//! of a line always arrives, because the host waits for the answer to each line. M110 always arrives whole, because
//! it sets the line numbers.

use kerf_sim::mechanics::Random;

/// The wire.
pub struct Damage {
    one_in: u64,
    random: Random,
    line: Vec<u8>,
    numbered: u64,
    damaged: u64,
}

impl Damage {
    /// Damages one in `one_in` numbered lines.
    pub fn new(one_in: u64, seed: u64) -> Self {
        let random = Random::new(seed);
        Self { one_in: one_in.max(1), random, line: Vec::new(), numbered: 0, damaged: 0 }
    }

    /// Number of numbered lines, and how many of them were damaged.
    pub fn counts(&self) -> (u64, u64) {
        (self.numbered, self.damaged)
    }

    /// Takes what the host has sent. Returns what arrives at the board, whole lines at a time.
    pub fn pass(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut out = Vec::new();
        for byte in bytes {
            if *byte != b'\n' {
                self.line.push(*byte);
                continue;
            }
            let line = std::mem::take(&mut self.line);
            out.extend(self.arrives(line));
            out.push(b'\n');
        }
        out
    }

    fn arrives(&mut self, mut line: Vec<u8>) -> Vec<u8> {
        if !line.starts_with(b"N") || line.windows(4).any(|text| text == b"M110") {
            return line;
        }
        self.numbered += 1;
        if self.random.below(self.one_in) != 0 {
            return line;
        }
        self.damaged += 1;
        let at = self.random.below(line.len() as u64) as usize;
        let byte = self.random.below(256) as u8;
        match self.random.below(5) {
            0 => line[at] ^= 1 << (byte & 7),
            1 => drop(line.remove(at)),
            2 => line.insert(at, byte),
            3 => line.truncate(at),
            _ => line[at] = byte,
        }
        line
    }
}

#[cfg(test)]
mod tests {
    use super::Damage;

    #[test]
    fn one_line_in_ten_is_damaged_and_no_other() {
        let mut damage = Damage::new(10, 1);
        let whole = b"N5 G1 X10*87\n".repeat(1_000);
        let out = damage.pass(&whole);
        let (numbered, damaged) = damage.counts();
        assert_eq!(numbered, 1_000);
        assert!((60..140).contains(&damaged), "{damaged}");
        let same = out.split(|b| *b == b'\n').filter(|line| *line == b"N5 G1 X10*87").count();
        assert!(same as u64 >= numbered - damaged);
        let others = b"M105\nN0 M110 N0*125\n".repeat(100);
        assert_eq!(damage.pass(&others), others);
    }

    #[test]
    fn lines_in_pieces_are_whole_again() {
        let mut damage = Damage::new(1_000_000, 1);
        let mut out = damage.pass(b"M1");
        out.extend(damage.pass(b"05\nM2"));
        assert_eq!(out, b"M105\n");
    }
}
