//! The SD card of an emulated board. The emulator is a process of its own, so what is on the card goes through a file.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use anyhow::{Context, Result};
use serde::Serialize;

use super::Emulated;

/// A card that is put into the slot.
#[derive(Serialize, Debug)]
pub(super) struct Card {
    file: PathBuf,
    select: u8,
    clock: u8,
}

/// What becomes of the card.
#[derive(Serialize, Default, Debug)]
pub(super) struct Slot {
    #[serde(skip_serializing_if = "Option::is_none")]
    there: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    access: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    keep: Option<PathBuf>,
}

/// Returns the name of a file that nobody else has.
fn scratch() -> PathBuf {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    std::env::temp_dir().join(format!("kerf-card-{}-{number}", std::process::id()))
}

impl Emulated {
    /// Puts an SD card with these contents into the board's slot.
    pub fn insert_card(&mut self, image: &[u8]) -> Result<()> {
        let card = self.board.card.context("the board has no card")?;
        let file = scratch();
        fs::write(&file, image)?;
        let (select, clock) = (card.select.bit, card.bus[0].bit);
        self.request.card = Some(Card { file: file.clone(), select, clock });
        self.run(0, false)?;
        fs::remove_file(file)?;
        Ok(())
    }

    /// Returns the contents of the card.
    pub fn card(&mut self) -> Result<Vec<u8>> {
        let file = scratch();
        self.request.slot = Some(Slot { keep: Some(file.clone()), ..Slot::default() });
        self.run(0, false)?;
        let image = fs::read(&file)?;
        fs::remove_file(file)?;
        Ok(image)
    }

    /// Pulls the card, or puts it back.
    pub fn put_card(&mut self, there: bool) {
        self.request.slot = Some(Slot { there: Some(there), ..Slot::default() });
    }

    /// Sets how long the card takes for a block, us.
    pub fn set_card_access(&mut self, access_us: u32) {
        self.request.slot = Some(Slot { access: Some(access_us), ..Slot::default() });
    }
}
