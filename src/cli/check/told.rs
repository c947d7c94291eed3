//! The result of a dry run as text.

use std::fmt::{self, Display, Formatter};

use kerf::canon::advice;

use super::dialect::{Dialect, Reason};
use super::stream::{Refused, Streamed};
use super::{Answer, Extent};

/// How much longer a job may take whose lines come as fast as the board can take them, percent.
const SLOWER: u32 = 8;

impl Display for Answer {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Streamed { lines, refused, stops, notes, busiest, .. } = &self.streamed;
        writeln!(f, "dialect {} ({})", self.dialect.name(), self.because)?;
        for Refused { line, text, reason: Reason { text: says, status } } in refused {
            writeln!(f, "line {line}: {text}")?;
            writeln!(f, "    {says}")?;
            if let Some((cause, cure)) = status.and_then(advice) {
                writeln!(f, "    why: {cause}\n    do:  {cure}")?;
            }
        }
        let mut told: Vec<_> = stops.iter().chain(notes).collect();
        told.sort_by_key(|(line, _)| *line);
        for (line, what) in told {
            writeln!(f, "line {line}: {what}")?;
        }
        writeln!(f, "{lines} lines, {} refused", refused.len())?;
        writeln!(f, "{:4}{:>12}{:>12}{:>12}{:>26}", "", "from", "to", "size", "travel")?;
        self.extents.iter().try_for_each(|extent| write!(f, "{extent}"))?;
        if self.extents.iter().any(|extent| extent.zero.is_none()) {
            writeln!(
                f,
                "from and to are from the work zero; --zero X,Y,Z says where that is, and has it checked"
            )?;
        }
        let (s, tenths) = (self.ms / 1_000, self.ms % 1_000 / 100);
        write!(f, "time {}:{:02}:{:02}.{tenths}", s / 3_600, s / 60 % 60, s % 60)?;
        let heats = if self.dialect == Dialect::RepRap { ", without heating" } else { "" };
        let lacks = if refused.is_empty() { "" } else { ", without the refused lines" };
        writeln!(f, "{heats}{lacks}")?;
        if self.is_rushed() {
            writeln!(
                f,
                "up to {SLOWER} % more: {busiest} lines in a second are about what the board can do"
            )?;
        }
        writeln!(f, "result: {}", if self.is_good() { "OK" } else { "FAILED" })
    }
}

impl Display for Extent {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Extent { axis, from, to, travel: (lower, upper), .. } = self;
        let travel = format!("{lower:.3} to {upper:.3}");
        let size = to - from;
        let fits = if self.fits() { "" } else { "   does not fit" };
        let axis = axis.to_uppercase();
        writeln!(f, "{axis:4}{from:>12.3}{to:>12.3}{size:>12.3}{travel:>26}{fits}")
    }
}
