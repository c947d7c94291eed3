//! The boards by name. Their pins and timers are data in `boards/`.

use std::fmt;

use anyhow::{Context, Result};

use clap::ValueEnum;

use crate::process::root;

/// A board that firmware is built for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Board {
    /// Arduino Mega 2560 with a grbl-style shield
    #[default]
    #[value(name = "mega2560-grbl")]
    Mega2560Grbl,
    /// Arduino Mega 2560 with a grbl-style shield, on a lathe, for senders that speak grbl's dialect
    #[value(name = "mega2560-grbl-lathe")]
    Mega2560GrblLathe,
    /// Arduino Mega 2560 with a grbl-style shield, on a lathe
    #[value(name = "mega2560-lathe")]
    Mega2560Lathe,
    /// Raspberry Pi Pico on a breakout board
    #[value(name = "pico")]
    Pico,
    /// Raspberry Pi Pico on a breakout board with six drivers
    #[value(name = "pico6")]
    Pico6,
    /// Expatria PicoBOB, with five drivers
    #[value(name = "picobob")]
    PicoBob,
    /// PicoCNC
    #[value(name = "picocnc")]
    PicoCnc,
    /// Expatria PicoHAL
    #[value(name = "picohal")]
    PicoHal,
    /// Arduino Mega 2560 with RAMPS 1.4, as a printer
    #[value(name = "ramps14")]
    Ramps14,
    /// Arduino Mega 2560 with RAMPS 1.4, as a mill
    #[value(name = "ramps14-cnc")]
    Ramps14Cnc,
    /// BTT SKR Pico v1.0
    #[value(name = "skr-pico")]
    SkrPico,
}

impl Board {
    /// Every board.
    pub fn all() -> &'static [Board] {
        Board::value_variants()
    }

    /// The Cargo features that the board's file asks for: dialects and capabilities.
    pub fn features(self) -> Result<Vec<String>> {
        listed(&self.data()?).with_context(|| format!("no line `features: &[...]` for {self}"))
    }

    /// The text of its file.
    fn data(self) -> Result<String> {
        let file = root().join(format!("boards/{self}.rs"));
        std::fs::read_to_string(&file).with_context(|| format!("no {}", file.display()))
    }

    /// The channel of timer 4 that makes the spindle's pulses; `None` on an RP2040.
    pub fn pwm_channel(self) -> Result<Option<u8>> {
        if self.is_rp2040() {
            return Ok(None);
        }
        let text = self.data()?;
        let (_, rest) = text.split_once("Timer::T4, channel: ").context("no pulses by timer 4")?;
        Ok(rest.chars().next().and_then(|digit| digit.to_digit(10)).map(|digit| digit as u8))
    }

    /// Whether its chip is the RP2040; otherwise it is the ATmega2560.
    pub fn is_rp2040(self) -> bool {
        use Board::{Pico, Pico6, PicoBob, PicoCnc, PicoHal, SkrPico};
        matches!(self, Pico | Pico6 | PicoBob | PicoCnc | PicoHal | SkrPico)
    }

    /// The name in `boards/`, on the command line and after `board-` in the package's features.
    pub fn name(self) -> &'static str {
        match self {
            Board::Mega2560Grbl => "mega2560-grbl",
            Board::Mega2560GrblLathe => "mega2560-grbl-lathe",
            Board::Mega2560Lathe => "mega2560-lathe",
            Board::Pico => "pico",
            Board::Pico6 => "pico6",
            Board::PicoBob => "picobob",
            Board::PicoCnc => "picocnc",
            Board::PicoHal => "picohal",
            Board::Ramps14 => "ramps14",
            Board::Ramps14Cnc => "ramps14-cnc",
            Board::SkrPico => "skr-pico",
        }
    }
}

impl fmt::Display for Board {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Returns the names that `features: &["a", "b"],` lists; `None` if there is no such list.
fn listed(text: &str) -> Option<Vec<String>> {
    let (_, rest) = text.split_once("\n    features: &[")?;
    let (list, _) = rest.split_once(']')?;
    Some(list.split('"').skip(1).step_by(2).map(str::to_owned).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::process::root;

    #[test]
    fn every_board_file_has_a_name_here_and_a_feature() {
        let files = std::fs::read_dir(root().join("boards")).unwrap();
        let mut files: Vec<_> = files
            .map(|f| f.unwrap().path())
            .filter(|f| f.extension() == Some("rs".as_ref()))
            .map(|f| f.file_stem().unwrap().to_owned())
            .collect();
        files.sort();
        let names: Vec<_> = Board::all().iter().map(|b| b.name()).collect();
        assert_eq!(files, names);

        let manifest = std::fs::read_to_string(root().join("Cargo.toml")).unwrap();
        for name in names {
            assert!(manifest.contains(&format!("\nboard-{name} = ")), "no feature board-{name}");
        }
    }

    #[test]
    fn command_line_names_are_the_board_names() {
        for board in Board::all() {
            assert_eq!(board.to_possible_value().unwrap().get_name(), board.name());
        }
    }

    #[test]
    fn features_of_boards_are_features_of_the_package() {
        let manifest = std::fs::read_to_string(root().join("Cargo.toml")).unwrap();
        for board in Board::all() {
            let features = board.features().unwrap();
            assert!(features.iter().any(|name| name.starts_with("dialect-")), "{board}");
            for name in features {
                assert!(manifest.contains(&format!("\n{name} = ")), "{board}: no feature {name}");
            }
        }
        assert_eq!(
            listed("\n    features: &[\n \"a\",\n \"b-c\",\n],"),
            Some(vec!["a".into(), "b-c".into()])
        );
        assert_eq!(listed("features"), None);
    }
}
