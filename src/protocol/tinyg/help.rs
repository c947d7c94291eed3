//! Text mode: help for people at a terminal.

use super::Mode;
use super::request::{Context, Phase, Request};
use super::write::Writer;
use crate::capability::Capability;
use crate::progmem;
use crate::progmem::Text;
use crate::protocol::{Machine, Out, Span};
use crate::status::Status;
use crate::text;

/// The number of lines in [`SCREENS`]. A screen is a range of them.
const LINES: usize = 64;
/// The screen for `h`.
pub const GENERAL: Span = Span { start: 0, end: 19 };
/// The screen for `$h`.
pub const SETTINGS: Span = Span { start: 19, end: 34 };
/// The screen for `$defa`.
pub const DEFAULTS: Span = Span { start: 34, end: 39 };
/// The screen for `$test`.
pub const TESTS: Span = Span { start: 39, end: 56 };
/// The screen for `$boot`.
pub const BOOT: Span = Span { start: 56, end: 61 };
/// The first of the hints for grbl's commands.
const HINTS: u8 = 61;

/// A command of grbl that has another name here. grbl's commands are in capitals; `$h` and `$x` are TinyG's.
#[derive(Clone, Copy, PartialEq, Debug)]
#[repr(u8)]
pub(super) enum Hint {
    /// `$H`.
    Home,
    /// `$X`.
    Unlock,
    /// `$100=80`, `$1=25`.
    Numbered,
}

#[small]
impl Hint {
    /// Returns the hint for a name. `asked`: whether the name has no value. `None` if the name is no command of grbl.
    pub fn of(name: &[u8], asked: bool) -> Option<Hint> {
        match name {
            b"H" if asked => Some(Hint::Home),
            b"X" if asked => Some(Hint::Unlock),
            [_, ..] if !(asked && name.len() == 1) && name.iter().all(u8::is_ascii_digit) => {
                Some(Hint::Numbered)
            }
            _ => None,
        }
    }
}

progmem! {
    static SCREENS: [Text; LINES] = [
        text!("### Kerf Help ###"),
        text!("Lines of G-code are run and answered with a prompt."),
        text!("These act as well:"),
        text!("  ?         status report"),
        text!("  $  $$     settings of the machine, all settings"),
        text!("  $h        help with settings"),
        text!("  $defa=1   all settings back to their defaults"),
        text!("  $test     list of built-in jobs; $test=3 runs one"),
        text!("  $me $md   motors on, motors off"),
        text!("  h         this help"),
        text!("  !         stop: slow down and hold"),
        text!("  ~         resume after a hold, or a program stop"),
        text!("  !%        stop and discard what is queued"),
        text!("  ^d        stop, discard, and end the program"),
        text!("  $clear    clear an alarm"),
        text!("  $home=1   home all axes that have a switch"),
        text!("  ^x        reset: the position is lost"),
        text!("  {...}     JSON; answers are JSON from then on"),
        text!("All codes: docs/gcode.md. All settings: docs/settings.md"),

        text!("### Kerf Settings Help ###"),
        text!("To show:"),
        text!("  $x        settings of an axis: x y z a b c"),
        text!("  $1        settings of a motor: 1 2 3 4"),
        text!("  $sys      settings of the machine; $ does so too"),
        text!("  $m $q     all motors, all axes"),
        text!("  $o        offsets, stored positions; $tt1 a tool"),
        text!("  $$        everything"),
        text!("  $xvm      one setting, here: x velocity maximum"),
        text!("  $posx     one value, here: where x is"),
        text!("To set one, with = or a blank between:"),
        text!("  $xvm=1200"),
        text!("  $xvm 1200"),
        text!("Settings stay when the power goes."),
        text!("What each one means: docs/settings.md in the sources."),

        text!("### Kerf Defaults Help ###"),
        text!("  $defa=1   sets all settings to their defaults"),
        text!("Your own values are gone then: note them first ($$)."),
        text!("Offsets of G54 to G59.3 and tools are kept."),
        text!("It is refused while the machine moves."),

        text!("### Kerf Test Jobs Help ###"),
        text!("Start at zero; leave 80 mm free in X and Y, 40 mm in Z."),
        text!("  $test=1   smoke test: outputs, all axes"),
        text!("  $test=2   homing"),
        text!("  $test=3   squares"),
        text!("  $test=4   arcs"),
        text!("  $test=5   dwells"),
        text!("  $test=6   a long move, to try hold and resume"),
        text!("  $test=7   spindle and coolant"),
        text!("  $test=9   inverse time"),
        text!("  $test=10  rotary axes"),
        text!("  $test=11  small moves"),
        text!("  $test=12  slow moves"),
        text!("  $test=13  offsets"),
        text!("  $test=51  braid: 2,500 short moves"),
        text!("  $test=0   ends the job that runs"),
        text!("  $test=100 your own: $prog=f, $prog=G0 X1, ..., $prog=t"),

        text!("### Kerf Boot Loader Help ###"),
        text!("  $boot=1   starts the boot loader of the board"),
        text!("It waits a second or so for a programmer, and"),
        text!("starts the machine anew then: the position is lost."),
        text!("It is refused while the machine moves."),

        text!("To home as $H of grbl does: $home=1. Help: $h"),
        text!("To unlock as $X of grbl does: $clear. Settings of X: $x"),
        text!("grbl's numbers have names here: $xvm for $110. All: $$"),
    ];
}

#[small]
impl Request {
    /// Shows a screen, or refuses if this image has no help.
    pub(super) fn help(&mut self, screen: Span) {
        match Capability::Help.check() {
            Ok(()) => {
                self.block = screen;
                self.phase = Phase::Help;
            }
            Err(status) => self.fail(status, Mode::Text),
        }
    }

    /// Shows the hint for a `$` line of grbl, which is refused with `status`.
    pub(super) fn hint(&mut self, hint: Hint, status: Status) {
        let line = HINTS + hint as u8;
        self.help(Span { start: line, end: line + 1 });
        self.status = status;
    }

    /// Writes one line of the screen.
    pub(super) fn help_line<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let is_built_in = Capability::Help.is_built_in();
        let line = if is_built_in { SCREENS.at(self.block.start.into()) } else { None };
        if let Some(line) = line {
            let mut writer = Writer::body(c.out, &mut self.format);
            if line.bytes().next() == Some(b'#') {
                (0..3).for_each(|_| writer.end_line());
            }
            writer.text(line);
            writer.end_line();
        }
        self.block.start += 1;
        if self.block.start >= self.block.end {
            self.block = Span::default();
            self.phase = Phase::Prompt;
        }
    }
}

/// Whether a line, apart from leading blanks, is one of text mode.
#[small]
pub fn is_text_command(line: &[u8]) -> bool {
    let mut bytes = line.iter().skip_while(|byte| matches!(byte, b' ' | b'\t'));
    matches!(bytes.next(), Some(b'$' | b'?')) || asks_help(line)
}

/// Whether a line is the letter H alone.
#[small]
pub fn asks_help(line: &[u8]) -> bool {
    let mut bytes = line.iter().filter(|byte| !matches!(byte, b' ' | b'\t'));
    matches!((bytes.next(), bytes.next()), (Some(b'h' | b'H'), None))
}
