//! Text mode: lines that begin with `$`.

use super::help::Hint;
use super::json::{Kind, Pair};
use super::listing::Series;
use super::request::{Context, Phase, Request};
use super::token::{Group, Operation, Target, resolve};
use super::{Mode, help};
use crate::capability::Capability;
use crate::config::{Name, Owner};
#[cfg(feature = "sd")]
use crate::protocol::files::Files;
use crate::protocol::{Machine, Out, Span};
use crate::status::Status;

#[small]
impl Request {
    /// Shows, sets or does what the line asks for. `at` is behind the `$`.
    #[inline(never)]
    pub(super) fn command<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let pair = split(c.line, self.at);
        let pair = divide(c.line, &pair).unwrap_or(pair);
        let name = Name::beginning(pair.name.of(c.line));
        let null = pair.kind == Kind::Null;
        if let Some(hint) = Hint::of(pair.name.of(c.line), null) {
            return self.hint(hint, Status::UnrecognizedName);
        }
        let series = match name.bytes() {
            [letter] if null => Series::of_letter(*letter),
            _ => None,
        };
        if series.is_some() {
            return self.enlist(None, series);
        }
        if name.bytes().is_empty() && null {
            return self.enlist(Some(Group::Settings(Owner::System)), None);
        }
        let target = resolve(Name::new(), name.bytes());
        match target {
            Target::Group(group) if null => self.enlist(Some(group), None),
            // In text mode neither a group nor a block can be given a value.
            Target::Group(_)
            | Target::Operation(
                Operation::Block | Operation::Text | Operation::Message | Operation::Id,
            ) => {
                self.refuse();
            }
            Target::Operation(Operation::Exception) => {
                self.fail(Status::ExceptionReport, Mode::Text)
            }
            Target::Operation(Operation::Help) => self.help(help::SETTINGS),
            Target::Operation(Operation::Test) if null => match Capability::Jobs.check() {
                Ok(()) => self.help(help::TESTS),
                Err(status) => self.fail(status, Mode::Text),
            },
            Target::Operation(Operation::Program) if null => {
                self.item = 0;
                self.phase = Phase::Program;
            }
            #[cfg(feature = "sd")]
            Target::Operation(Operation::Files(Files::List)) if null => match self.mount(c.machine)
            {
                Ok(()) => {
                    self.item = 0;
                    self.phase = Phase::Files;
                }
                Err(Status::Again) => self.waits = true,
                Err(status) => self.fail(status, Mode::Text),
            },
            Target::Operation(Operation::Defaults) if null => self.help(help::DEFAULTS),
            Target::Operation(Operation::Boot) if null => self.help(help::BOOT),
            _ => self.execute(&pair, target, c),
        }
    }

    fn execute<M: Machine, O: Out>(
        &mut self,
        pair: &Pair,
        target: Target,
        c: &mut Context<'_, M, O>,
    ) {
        match self.apply(pair, target, c) {
            Ok(Some(token)) => {
                self.enlist(Some(Group::One(token)), None);
            }
            Ok(None) => {
                // The status for restored defaults is for JSON only.
                self.status = Status::Ok;
                self.phase = Phase::Prompt;
            }
            Err(Status::Again) => self.waits = true,
            Err(status) => self.fail(status, Mode::Text),
        }
    }

    fn refuse(&mut self) {
        self.fail(Status::UnrecognizedName, Mode::Text);
    }
}

#[small]
fn is_separator(byte: u8) -> bool {
    matches!(byte, b'=' | b':' | b'|') || is_blank(byte)
}

#[small]
fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t')
}

/// Splits the text at `at` into a name and the value behind it. Any value is taken for a number.
#[small]
fn split(line: &[u8], at: u8) -> Pair {
    let byte = |at: u8| line.get(usize::from(at)).copied();
    let skip = |mut at: u8, wanted: fn(u8) -> bool| {
        while byte(at).is_some_and(wanted) {
            at = at.saturating_add(1);
        }
        at
    };
    let start = skip(at, is_blank);
    let end = skip(start, |byte| !is_separator(byte));
    let value = skip(end, is_separator);
    let mut next = line.len() as u8;
    while next > value && byte(next - 1).is_some_and(is_blank) {
        next -= 1;
    }
    let kind = if value < next { Kind::Number } else { Kind::Null };
    Pair { name: Span { start, end }, kind, value: Span { start: value, end: next }, next }
}

/// Divides a setting and a number without a separator, as in `$xfr30`. This is unambiguous: no name is another name
/// followed by digits. `None` if the text is nothing of this kind.
#[inline(never)]
#[small]
fn divide(line: &[u8], pair: &Pair) -> Option<Pair> {
    let text = pair.name.of(line);
    let is_number = |byte: &&u8| matches!(byte, b'0'..=b'9' | b'.' | b',' | b'-');
    let digits = text.iter().rev().take_while(is_number).count() as u8;
    if pair.kind != Kind::Null || digits == 0 {
        return None;
    }
    let middle = pair.name.end - digits;
    let name = Span { end: middle, ..pair.name };
    let Target::Token(_) = resolve(Name::new(), name.of(line)) else { return None };
    let value = Span { start: middle, ..pair.name };
    Some(Pair { name, kind: Kind::Number, value, next: pair.name.end })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_values_are_told_apart() {
        for (line, name, value) in [
            ("$xvm", "xvm", None),
            ("$ xvm ", "xvm", None),
            ("$xvm=1200", "xvm", Some("1200")),
            ("$xvm 1200 \t", "xvm", Some("1200")),
            ("$xvm : 1,200", "xvm", Some("1,200")),
            ("$xvm|\t-1", "xvm", Some("-1")),
            ("$xvm=", "xvm", None),
            ("$", "", None),
            ("$=5", "", Some("5")),
            ("$$", "$", None),
        ] {
            let pair = split(line.as_bytes(), 1);
            assert_eq!(pair.name.of(line.as_bytes()), name.as_bytes(), "{line}");
            let kind = if value.is_some() { Kind::Number } else { Kind::Null };
            assert_eq!(pair.kind, kind, "{line}");
            assert_eq!(pair.value.of(line.as_bytes()), value.unwrap_or("").as_bytes(), "{line}");
        }
    }

    #[test]
    fn no_name_is_another_with_digits_behind_it() {
        for name in super::super::token::names() {
            let head = name.trim_end_matches(|c: char| c.is_ascii_digit());
            let target = resolve(Name::new(), head.as_bytes());
            assert!(head == name || !matches!(target, Target::Token(_)), "{name}");
        }
    }

    #[test]
    fn a_line_may_fill_the_index() {
        let mut line = [b' '; 255];
        line[0] = b'$';
        line[254] = b'x';
        assert_eq!(split(&line, 1).name, Span { start: 254, end: 255 });
        line[1..].fill(b'x');
        assert_eq!(split(&line, 1).kind, Kind::Null);
    }
}
