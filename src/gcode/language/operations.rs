//! Operators and functions of expressions. Angles are in degrees.
//!
//! The functions come from `libm` on each chip and on the host, so that a program gives equal results on both. A result
//! that is no finite number is refused with [`Status::ValueUndefined`], as are arguments outside of a function's range.
//!
//! Cost on the RP2040: about 5 us an operator, 60 us a function (estimated).

use super::text::Text;
use crate::status::Status;

/// An operator between two values.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Operator {
    Power,
    Times,
    Over,
    Modulo,
    Plus,
    Minus,
    Equal,
    Unequal,
    Greater,
    GreaterOrEqual,
    Less,
    LessOrEqual,
    And,
    Or,
    Xor,
}

use Operator::{
    And, Equal, Greater, GreaterOrEqual, Less, LessOrEqual, Minus, Modulo, Or, Over, Plus, Power,
    Times, Unequal, Xor,
};

/// The operators as they are written. One that begins like another stands before it.
const OPERATORS: [(&[u8], Operator); 15] = [
    (b"**", Power),
    (b"*", Times),
    (b"/", Over),
    (b"MOD", Modulo),
    (b"+", Plus),
    (b"-", Minus),
    (b"EQ", Equal),
    (b"NE", Unequal),
    (b"GT", Greater),
    (b"GE", GreaterOrEqual),
    (b"LT", Less),
    (b"LE", LessOrEqual),
    (b"AND", And),
    (b"OR", Or),
    (b"XOR", Xor),
];

/// Two values that differ by less are equal.
const EQUAL: f64 = 1e-6;

impl Operator {
    /// Reads an operator.
    pub fn read(text: &mut Text) -> Option<Self> {
        OPERATORS.iter().find(|(name, _)| text.eat_word(name)).map(|(_, operator)| *operator)
    }

    /// Returns the rank: operators of a higher one bind tighter. Those of equal rank apply from left to right.
    pub fn rank(self) -> u8 {
        match self {
            Power => 5,
            Times | Over | Modulo => 4,
            Plus | Minus => 3,
            Equal | Unequal | Greater | GreaterOrEqual | Less | LessOrEqual => 2,
            And | Or | Xor => 1,
        }
    }

    /// Applies the operator to two finite values.
    pub fn apply(self, a: f64, b: f64) -> Result<f64, Status> {
        let truth = |is: bool| if is { 1.0 } else { 0.0 };
        let equal = (a - b).abs() < EQUAL;
        finite(match self {
            Power if a < 0.0 && libm::floor(b) != b => return Err(Status::ValueUndefined),
            Power => libm::pow(a, b),
            Times => a * b,
            Over => a / b,
            Modulo => modulo(a, b),
            Plus => a + b,
            Minus => a - b,
            Equal => truth(equal),
            Unequal => truth(!equal),
            Greater => truth(a > b),
            GreaterOrEqual => truth(a > b || equal),
            Less => truth(a < b),
            LessOrEqual => truth(a < b || equal),
            And => truth(a != 0.0 && b != 0.0),
            Or => truth(a != 0.0 || b != 0.0),
            Xor => truth((a != 0.0) != (b != 0.0)),
        })
    }
}

/// Returns the remainder of a division, which is never negative.
fn modulo(a: f64, b: f64) -> f64 {
    let rest = libm::fmod(a, b);
    if rest < 0.0 { rest + b.abs() } else { rest }
}

/// Refuses what is no number, and infinity.
fn finite(value: f64) -> Result<f64, Status> {
    if value.is_finite() { Ok(value) } else { Err(Status::ValueUndefined) }
}

/// A function of one value in brackets. ATAN and EXISTS are not among them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Function {
    Abs,
    Acos,
    Asin,
    Cos,
    Exp,
    Fix,
    Fup,
    Ln,
    Round,
    Sin,
    Sqrt,
    Tan,
}

use Function::{Abs, Acos, Asin, Cos, Exp, Fix, Fup, Ln, Round, Sin, Sqrt, Tan};

const FUNCTIONS: [(&[u8], Function); 12] = [
    (b"ABS", Abs),
    (b"ACOS", Acos),
    (b"ASIN", Asin),
    (b"COS", Cos),
    (b"EXP", Exp),
    (b"FIX", Fix),
    (b"FUP", Fup),
    (b"LN", Ln),
    (b"ROUND", Round),
    (b"SIN", Sin),
    (b"SQRT", Sqrt),
    (b"TAN", Tan),
];

impl Function {
    /// Reads the name of a function.
    pub fn read(text: &mut Text) -> Option<Self> {
        FUNCTIONS.iter().find(|(name, _)| text.eat_word(name)).map(|(_, function)| *function)
    }

    /// Applies the function to a finite value.
    pub fn apply(self, x: f64) -> Result<f64, Status> {
        finite(match self {
            Abs => x.abs(),
            Acos => libm::acos(x).to_degrees(),
            Asin => libm::asin(x).to_degrees(),
            Cos => libm::cos(turned(x)),
            Exp => libm::exp(x),
            Fix => libm::floor(x),
            Fup => libm::ceil(x),
            Ln => libm::log(x),
            // Halves go away from 0.
            Round => libm::round(x),
            Sin => libm::sin(turned(x)),
            Sqrt => libm::sqrt(x),
            Tan => libm::tan(turned(x)),
        })
    }
}

/// Converts an angle to radians, less whole turns. The remainder of a division is exact.
fn turned(degrees: f64) -> f64 {
    libm::fmod(degrees, 360.0).to_radians()
}

/// Returns the angle of the point (x, y), -180 to 180.
pub fn angle(y: f64, x: f64) -> Result<f64, Status> {
    finite(libm::atan2(y, x).to_degrees())
}
