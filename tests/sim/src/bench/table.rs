//! The table as text.

use std::io::{self, Write};

use anyhow::Result;

use super::{Bed, Figure, Row};

/// What the reader must know about the figures.
const FOOTER: &str = "
grbl-Mega 1.1g and Teacup (2023): built from their published sources and measured on the same simulated
CPU with interrupt, UART and timer models of their own, with the same settings (80 steps/mm, Z 400; 500 mm/s2; junction deviation 0.01 mm), at 115,200 baud.
TinyG: published for its own chip, an ATxmega192 at 32 MHz. Rates are held if the mean at cruise is within
1 % of the command and the end exact. Jitter is peak to peak of the interval between steps. Moves are 2,000
along a spiral at 6,000 mm/min; their time runs from the first step to the last, and the ideal is unlimited
look-ahead with trapezoids, way / v + v / a. Kerf runs with a jerk limit out of the way to be comparable,
but for the rows that name one: 5,000 million mm/min3 unless they say another. The floor is what the tests insist on; * marks targets that are not reached.
";

/// Measures the rows, prints each as soon as it is measured, and then the footer. Returns true when every row was
/// measured.
pub fn print(bed: &Bed, rows: &[&Row], out: &mut impl Write) -> Result<bool> {
    let complete = print_rows(bed, rows, out)?;
    write!(out, "{FOOTER}")?;
    Ok(complete)
}

/// As [`print`], for the rows of any board, without the footer.
pub fn print_rows<B>(bed: &B, rows: &[&Row<B>], out: &mut impl Write) -> Result<bool> {
    line(out, &["what", "grbl-Mega", "TinyG", "Teacup", "Kerf", "target", "floor", "unit"], "")?;
    writeln!(out, "{}", "-".repeat(146))?;
    let mut complete = true;
    for row in rows {
        let measured = (row.measure)(bed);
        complete &= measured.is_ok();
        print_row(out, row, measured)?;
    }
    Ok(complete)
}

fn print_row<B>(out: &mut impl Write, row: &Row<B>, measured: Result<Figure>) -> io::Result<()> {
    let number = |value: f64| grouped(value, row.decimals);
    let limit = |value: Option<f64>| value.map_or("-".to_string(), number);
    let (kerf, note) = match measured {
        Ok(figure) => {
            let reached = row.target.is_none_or(|t| row.better.reaches(figure.value, t));
            (number(figure.value) + if reached { "" } else { "*" }, figure.note)
        }
        Err(why) => ("failed".to_string(), format!("{why:#}")),
    };
    let [grbl, tinyg, teacup] = row.peers;
    let (target, floor) = (limit(row.target), limit(row.floor));
    line(out, &[row.what, grbl, tinyg, teacup, &kerf, &target, &floor, row.unit], &note)
}

fn line(out: &mut impl Write, cells: &[&str; 8], note: &str) -> io::Result<()> {
    let [what, grbl, tinyg, teacup, kerf, target, floor, unit] = cells;
    let text = format!(
        "{what:<48}{grbl:>16}{tinyg:>10}{teacup:>19}{kerf:>11}{target:>10}{floor:>10}  {unit:<8} {note}"
    );
    writeln!(out, "{}", text.trim_end())?;
    out.flush()
}

/// A number with commas between its thousands.
fn grouped(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let (whole, rest) = text.split_at(text.find('.').unwrap_or(text.len()));
    let comma = |i: usize| i > 0 && (whole.len() - i).is_multiple_of(3);
    let digits = whole.char_indices();
    let whole: String =
        digits.flat_map(|(i, c)| comma(i).then_some(',').into_iter().chain([c])).collect();
    whole + rest
}

#[cfg(test)]
mod tests {
    use super::grouped;

    #[test]
    fn thousands_are_apart() {
        assert_eq!(grouped(1_234_567.0, 0), "1,234,567");
        assert_eq!(grouped(66_000.0, 0), "66,000");
        assert_eq!(grouped(999.5, 1), "999.5");
        assert_eq!(grouped(1.0125, 3), "1.012");
    }
}
