//! The chip's arithmetic in assembly has the same results as its twin on the host, to the bit: for all pairs of edge
//! cases, and for random numbers.
//!
//! `cargo xtask examples` builds the image that does it from `tests/chip/arithmetic.rs`. `KERF_SEED` and `KERF_CASES`
//! choose the random cases.

use core::num::FpCategory;

use kerf::boards::MEGA2560_GRBL;
use kerf::hal::arithmetic;
use kerf::motion::divide;
use kerf_sim::Machine;
use kerf_sim::mechanics::Random;

use crate::common::part;

/// Number of random cases by default.
const USUAL: u64 = 30_000;
/// Cycles between two checks for the results.
const LOOK: u64 = 100;
/// Longest wait for the results, cycles: far more than all of the arithmetic takes.
const PATIENCE: u64 = 100_000;

/// The operands for the chip.
#[derive(Clone, Copy, Debug, Default)]
struct Case {
    /// The first operand. Functions with fewer bits take its lowest bits.
    a: u64,
    b: u32,
}

/// The results.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Results {
    /// The quotient and the remainder; `None` where the quotient does not fit.
    divide: Option<(u16, u16)>,
    inlined_quotient: Option<u16>,
    /// `None` where the quotient does not fit.
    wide_quotient: Option<u32>,
    product: u32,
    times: u32,
    high_product: u8,
    root: u16,
    inverse_root: u16,
    /// The bits of the quotient of two floats, as returned by [`bits`].
    ratio: u32,
    whole: u32,
}

/// Returns the bits of a quotient. All NaNs become one NaN. A subnormal quotient keeps only its sign, because the
/// chip's library flushes it to zero and the host rounds it.
fn bits(quotient: f32) -> u32 {
    match quotient.classify() {
        FpCategory::Nan => f32::NAN.to_bits(),
        FpCategory::Subnormal => 0f32.copysign(quotient).to_bits(),
        _ => quotient.to_bits(),
    }
}

impl Case {
    fn new(a: u64, b: u32) -> Self {
        Case { a, b }
    }

    /// Whether a quotient of 32 bits by 16 fits.
    fn fits(&self) -> bool {
        (self.a as u32) >> 16 < self.b & 0xFFFF
    }

    /// Whether a quotient of 64 bits by 32 fits.
    fn fits_wide(&self) -> bool {
        self.a >> 32 < self.b.into()
    }

    /// Returns the host's results.
    fn on_host(&self) -> Results {
        let (a, b) = (self.a as u32, self.b);
        Results {
            divide: self.fits().then(|| divide::quotient_remainder(a, b as u16)),
            inlined_quotient: self.fits().then(|| arithmetic::divide(a, b as u16).0),
            wide_quotient: self.fits_wide().then(|| arithmetic::wide_quotient(self.a, b)),
            product: arithmetic::product(a as u16, b as u16),
            times: arithmetic::times(a, b as u8),
            high_product: arithmetic::high_product(a as u8, b as u8),
            root: divide::root(a),
            inverse_root: arithmetic::inverse_root(a as u16),
            ratio: bits(arithmetic::ratio(f32::from_bits(a), f32::from_bits(b))),
            whole: arithmetic::whole(f32::from_bits(a)),
        }
    }
}

/// The chip, and the addresses of its operands and results.
struct Chip {
    machine: Machine,
    turn: u16,
    operands: u16,
    results: u16,
}

impl Chip {
    fn new() -> Self {
        let machine = Machine::load(&part("arithmetic"), &MEGA2560_GRBL).unwrap();
        let at = |name: &str| machine.image().variable(name).expect("a static of the image");
        Chip { turn: at("TURN"), operands: at("OPERANDS"), results: at("RESULTS"), machine }
            .started()
    }

    /// Waits for the start-up, which clears the memory.
    fn started(mut self) -> Self {
        self.machine.run_for_ms(10).unwrap();
        self
    }

    fn put(&mut self, at: u16, bytes: impl IntoIterator<Item = u8>) {
        for (at, byte) in (at..).zip(bytes) {
            self.machine.poke(at, byte);
        }
    }

    /// Returns the chip's results.
    fn results(&mut self, case: &Case) -> Results {
        self.put(self.operands, case.a.to_le_bytes().into_iter().chain(case.b.to_le_bytes()));
        self.put(self.turn, [1]);
        let end = self.machine.cycle() + PATIENCE;
        while self.machine.peek(self.turn) != 0 {
            assert!(self.machine.cycle() < end, "no results of {case:x?}");
            self.machine.run_until(self.machine.cycle() + LOOK).unwrap();
        }
        let word = |n: u16| self.machine.peek_word(self.results + 2 * n);
        let two = |n: u16| u32::from(word(n + 1)) << 16 | u32::from(word(n));
        Results {
            divide: case.fits().then(|| (word(0), word(1))),
            inlined_quotient: case.fits().then(|| word(14)),
            wide_quotient: case.fits_wide().then(|| two(2)),
            product: two(4),
            times: two(6),
            high_product: word(8) as u8,
            root: word(9),
            inverse_root: word(15),
            ratio: bits(f32::from_bits(two(10))),
            whole: two(12),
        }
    }

    /// Checks that the chip and the host agree.
    fn agrees(&mut self, case: &Case) {
        let (chip, host) = (self.results(case), case.on_host());
        assert_eq!(chip, host, "the chip, and the host, of {case:x?}");
    }
}

/// Returns 0, the powers of two and their neighbours, and the largest number.
fn edges() -> Vec<u32> {
    let powers = (0..32).map(|n| 1u32 << n);
    let mut all: Vec<u32> = powers.flat_map(|power| [power - 1, power, power + 1]).collect();
    all.extend([u32::MAX - 1, u32::MAX]);
    all.sort_unstable();
    all.dedup();
    all
}

/// Floats with exponents and mantissas at their edges, of both signs: zeros, subnormal numbers, infinities and NaN
/// among them.
fn floats() -> Vec<u32> {
    const EXPONENTS: [u32; 15] =
        [0, 1, 2, 23, 64, 125, 126, 127, 128, 150, 157, 158, 252, 254, 255];
    const MANTISSAS: [u32; 6] = [0, 1, 0x3F_FFFF, 0x40_0000, 0x7F_FFFE, 0x7F_FFFF];
    let signs = [0, 1u32 << 31].into_iter();
    let all = signs.flat_map(|sign| EXPONENTS.map(|exponent| sign | exponent << 23));
    all.flat_map(|upper| MANTISSAS.map(|mantissa| upper | mantissa)).collect()
}

/// Returns a number of any length up to `most` bits.
fn number(random: &mut Random, most: u64) -> u64 {
    let any = random.below(1 << 32) << 32 | random.below(1 << 32);
    any >> (64 - most) >> random.below(most)
}

/// Returns operands of all kinds.
fn random_case(random: &mut Random) -> Case {
    let b = number(random, 32) as u32;
    match random.below(5) {
        0 => Case::new(number(random, 64), b),
        // A quotient of 16 bits that is exact, or nearly, or leaves the largest remainder.
        1 => {
            let b = (b as u16).max(1);
            let rest = [0, 1, u32::from(b) - 1][random.below(3) as usize].min(u32::from(b) - 1);
            Case::new(u64::from(number(random, 16) as u32 * u32::from(b) + rest), b.into())
        }
        // A quotient of 32 bits that is exact, or nearly, or leaves the largest remainder.
        2 => {
            let b = u64::from(b.max(1));
            let rest = [0, 1, b - 1][random.below(3) as usize].min(b - 1);
            Case::new(number(random, 32) * b + rest, b as u32)
        }
        // Floats whose quotient is exact or nearly: during the division the remainder equals the divisor or is just
        // below it.
        3 => {
            let length = 1 + random.below(23) as u32;
            let mut of = |bits: u32| (1 << bits) + number(random, 32) as u32 % (1 << bits);
            let (quotient, y) = (of(length - 1), of(23 - length));
            let x = ((quotient * y) as f32).to_bits() + random.below(3) as u32 - 1;
            Case::new(x.into(), (y as f32).to_bits())
        }
        // Floats close to each other.
        _ => {
            let near = |random: &mut Random| {
                (100 + random.below(60)) << 23 | random.below(2) << 31 | random.below(1 << 23)
            };
            Case::new(near(random), near(random) as u32)
        }
    }
}

fn wanted(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|n| n.parse().expect("a number"))
}

#[test]
fn the_chip_gives_what_the_host_gives_of_edge_cases() {
    let mut chip = Chip::new();
    let edges = edges();
    for b in &edges {
        for a in &edges {
            // The operand also goes into the upper half, for the division by 32 bits.
            chip.agrees(&Case::new(u64::from(*a) << 32 | u64::from(!*a), *b));
            chip.agrees(&Case::new(u64::from(*a), *b));
        }
    }
    println!("{} pairs of integers", edges.len() * edges.len());
}

#[test]
fn the_chip_gives_what_the_host_gives_of_floats_at_the_edge() {
    let mut chip = Chip::new();
    let floats = floats();
    for b in &floats {
        for a in &floats {
            chip.agrees(&Case::new(u64::from(*a), *b));
        }
    }
    println!("{} pairs of floats", floats.len() * floats.len());
}

#[test]
fn the_chip_gives_what_the_host_gives_of_random_numbers() {
    let first = wanted("KERF_SEED").unwrap_or(0);
    let mut chip = Chip::new();
    for seed in first..first + wanted("KERF_CASES").unwrap_or(USUAL) {
        let case = random_case(&mut Random::new(seed));
        let (got, host) = (chip.results(&case), case.on_host());
        assert_eq!(got, host, "the chip, and the host, of {case:x?}: seed {seed}");
    }
}
