//! Text mode: help for people at a terminal.

use super::json::Span;
use super::machine::Machine;
use super::request::{Context, Phase, Request};
use super::write::{Out, Writer};
use crate::progmem;
use crate::progmem::Text;
use crate::text;

/// Lines of [`SCREENS`]; a screen is some of them.
const LINES: usize = 54;
/// What `h` shows.
pub const GENERAL: Span = Span { start: 0, end: 17 };
/// What `$h` shows.
pub const SETTINGS: Span = Span { start: 17, end: 32 };
/// What `$defa` shows.
pub const DEFAULTS: Span = Span { start: 32, end: 37 };
/// What `$test` shows.
pub const TESTS: Span = Span { start: 37, end: LINES as u8 };

progmem! {
    static SCREENS: [Text; LINES] = [
        text!("\n\n\n### Kerf Help ###\n"),
        text!("Lines of G-code are run and answered with a prompt.\n"),
        text!("These act as well:\n"),
        text!("  ?         status report\n"),
        text!("  $         settings of the machine\n"),
        text!("  $$        all settings\n"),
        text!("  $h        help with settings\n"),
        text!("  $defa=1   all settings back to their defaults\n"),
        text!("  $test     list of built-in jobs; $test=3 runs one\n"),
        text!("  $me $md   motors on, motors off\n"),
        text!("  h         this help\n"),
        text!("  ~         go on after a program stop\n"),
        text!("  ^x        reset: the position is lost\n"),
        text!("  {...}     JSON; answers are JSON from then on\n"),
        text!("To stop the machine at once, cut its power.\n"),
        text!("All codes: docs/gcode.md in the sources.\n"),
        text!("All settings: docs/settings.md in the sources.\n"),

        text!("\n\n\n### Kerf Settings Help ###\n"),
        text!("To show:\n"),
        text!("  $x        settings of an axis: x y z a b c\n"),
        text!("  $1        settings of a motor: 1 2 3 4\n"),
        text!("  $sys      settings of the machine; $ does so too\n"),
        text!("  $m $q     all motors, all axes\n"),
        text!("  $o        offsets, stored positions; $tt1 a tool\n"),
        text!("  $$        everything\n"),
        text!("  $xvm      one setting, here: x velocity maximum\n"),
        text!("  $posx     one value, here: where x is\n"),
        text!("To set one, with = or a blank between:\n"),
        text!("  $xvm=1200\n"),
        text!("  $xvm 1200\n"),
        text!("Settings stay when the power goes.\n"),
        text!("What each one means: docs/settings.md in the sources.\n"),

        text!("\n\n\n### Kerf Defaults Help ###\n"),
        text!("  $defa=1   sets all settings to their defaults\n"),
        text!("Your own values are gone then: note them first ($$).\n"),
        text!("Offsets of G54 to G59.3 and tools are kept.\n"),
        text!("It is refused while the machine moves.\n"),

        text!("\n\n\n### Kerf Test Jobs Help ###\n"),
        text!("Start at zero; leave 80 mm free in X and Y, 40 mm in Z.\n"),
        text!("  $test=1   smoke test: outputs, all axes\n"),
        text!("  $test=2   homing\n"),
        text!("  $test=3   squares\n"),
        text!("  $test=4   arcs\n"),
        text!("  $test=5   dwells\n"),
        text!("  $test=6   a long move, to try hold and resume\n"),
        text!("  $test=7   spindle and coolant\n"),
        text!("  $test=9   inverse time\n"),
        text!("  $test=10  rotary axes\n"),
        text!("  $test=11  small moves\n"),
        text!("  $test=12  slow moves\n"),
        text!("  $test=13  offsets\n"),
        text!("  $test=51  braid: 2,500 short moves\n"),
        text!("  $test=0   ends the job that runs\n"),
        text!("  $test=100 your own: $prog=f, $prog=G0 X1, ..., $prog=t\n"),
    ];
}

impl Request {
    /// Shows a screen.
    pub(super) fn help(&mut self, screen: Span) {
        self.block = screen;
        self.phase = Phase::Help;
    }

    /// A line of it.
    pub(super) fn help_line<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        if let Some(line) = SCREENS.at(self.block.start.into()) {
            Writer::body(c.out, &mut self.format).text(line);
        }
        self.block.start += 1;
        if self.block.start >= self.block.end {
            self.block = Span::default();
            self.phase = Phase::Prompt;
        }
    }
}

/// Whether a line is the letter H alone.
pub fn asks_help(line: &[u8]) -> bool {
    let mut bytes = line.iter().filter(|byte| !matches!(byte, b' ' | b'\t'));
    matches!((bytes.next(), bytes.next()), (Some(b'h' | b'H'), None))
}
