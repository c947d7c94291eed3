//! The log on a small memory whose power fails.

use core::cell::Cell;
use std::collections::HashMap;
use std::vec::Vec;

use proptest::prelude::*;

use super::*;

/// Eight slots and a remainder.
const BYTES: usize = 8 * SIZE as usize + 3;

/// A memory that loses power after a number of bytes. The last byte is then `torn`.
#[derive(Clone)]
struct Cells {
    bytes: [u8; BYTES],
    left: usize,
    torn: u8,
    written: Vec<u32>,
}

impl Cells {
    fn new() -> Self {
        Self { bytes: [0xFF; BYTES], left: usize::MAX, torn: 0, written: std::vec![0; BYTES] }
    }
}

impl Memory for Cells {
    const SIZE: u16 = BYTES as u16;

    fn read(&self, at: u16) -> u8 {
        self.bytes[usize::from(at)]
    }
    fn is_busy(&self) -> bool {
        false
    }
    fn write(&mut self, at: u16, byte: u8) {
        let at = usize::from(at);
        match self.left {
            0 => {}
            1 => self.bytes[at] = self.torn,
            _ => self.bytes[at] = byte,
        }
        self.left = self.left.saturating_sub(1);
        self.written[at] += 1;
    }
}

/// Stores an item. `false` if there is no room.
fn put(log: &mut Log, cells: &mut Cells, key: u16, value: i32) -> bool {
    for moved in 0.. {
        let (mut write, last) = match log.put(cells, key, value, moved) {
            Put::Room(write) => (write, false),
            Put::Last(write) => (write, true),
            Put::Full => return false,
        };
        while write.step(cells) {}
        if last {
            return true;
        }
    }
    false
}

/// Returns the values of several items.
fn find<const N: usize>(log: &Log, cells: &impl Memory, keys: &[u16; N]) -> [Option<i32>; N] {
    let mut values = [None; N];
    let found = log.search(cells, keys, |i, value| values[i] = Some(value));
    assert!((0..N).all(|i| values[i].is_some() == (found & 1 << i != 0)));
    values
}

#[test]
fn the_newest_value_counts() {
    let mut cells = Cells::new();
    let mut log = Log::open(&cells);
    assert_eq!(log.newest(&cells, 5), None);
    for value in 0..100 {
        assert!(put(&mut log, &mut cells, 5, value));
        assert!(put(&mut log, &mut cells, 6, -value));
        assert_eq!((log.newest(&cells, 5), log.newest(&cells, 6)), (Some(value), Some(-value)));
        assert_eq!(Log::open(&cells), log);
    }
}

#[test]
fn all_cells_wear_alike() {
    let mut cells = Cells::new();
    let mut log = Log::open(&cells);
    put(&mut log, &mut cells, 1, 1);
    for value in 0..8_000 {
        put(&mut log, &mut cells, 2, value);
    }
    let marks: Vec<u32> = (0..8).map(|slot| cells.written[slot * usize::from(SIZE)]).collect();
    let (least, most) = (marks.iter().min().unwrap(), marks.iter().max().unwrap());
    assert!(most - least <= 4, "{marks:?}");
    assert_eq!(log.newest(&cells, 1), Some(1));
}

#[test]
fn a_full_log_says_so_and_loses_nothing() {
    let mut cells = Cells::new();
    let mut log = Log::open(&cells);
    let stored = (0..20).filter(|key| put(&mut log, &mut cells, *key, 7)).count();
    assert_eq!(stored, 7, "one slot is the gap");
    for key in 0..7 {
        assert_eq!(log.newest(&cells, key), Some(7));
    }
    assert!(put(&mut log, &mut cells, 3, 9));
    assert_eq!(log.newest(&cells, 3), Some(9));
}

#[test]
fn items_are_found_together_as_alone() {
    let mut cells = Cells::new();
    let mut log = Log::open(&cells);
    for (key, value) in [(1, 10), (2, 20), (1, 11), (3, 30), (2, 21), (1, 12), (4, 40)] {
        assert!(put(&mut log, &mut cells, key, value));
    }
    assert_eq!(find(&log, &cells, &[3, 9, 1, 2]), [Some(30), None, Some(12), Some(21)]);
}

#[test]
fn rubbish_is_known() {
    let mut cells = Cells::new();
    assert!(!Log::open(&cells).is_rubbish(&cells));
    cells.bytes[4] = 0;
    assert!(!Log::open(&cells).is_rubbish(&cells), "the first record was cut short");
    cells.bytes[14] = 0;
    assert!(Log::open(&cells).is_rubbish(&cells));
    let mut log = Log::open(&cells);
    assert!(put(&mut log, &mut cells, 3, 9));
    assert!(!log.is_rubbish(&cells));
}

/// A memory that is written in pieces, as the flash of the RP2040 is. A pending piece takes further bytes of its own
/// range. `is_busy` writes the pending piece, and counts it in `kept`.
struct Pieces {
    cells: Cells,
    waiting: Cell<Option<u16>>,
    kept: Cell<u32>,
}

const PIECE: u16 = 32;

impl Memory for Pieces {
    const SIZE: u16 = Cells::SIZE;

    fn read(&self, at: u16) -> u8 {
        self.cells.read(at)
    }
    fn is_busy(&self) -> bool {
        self.kept.update(|kept| kept + u32::from(self.waiting.take().is_some()));
        false
    }
    fn takes(&self, at: u16) -> bool {
        self.waiting.get() == Some(at / PIECE) || !self.is_busy()
    }
    fn write(&mut self, at: u16, byte: u8) {
        let piece = Some(at / PIECE);
        assert!(self.waiting.get().is_none() || self.waiting.get() == piece);
        self.waiting.set(piece);
        self.cells.write(at, byte);
    }
}

#[test]
fn a_record_is_kept_in_one_piece_or_three() {
    let mut pieces = Pieces { cells: Cells::new(), waiting: Cell::new(None), kept: Cell::new(0) };
    let mut log = Log::open(&pieces);
    for value in 0..100 {
        let Put::Last(mut write) = log.put(&pieces, 5, value, 0) else { panic!("no room") };
        pieces.kept.set(0);
        while write.step(&mut pieces) {
            assert!(!write.waits(&pieces));
        }
        // The record's first byte is in the first piece, but is written last.
        assert!([1, 3].contains(&pieces.kept.get()), "{} pieces", pieces.kept.get());
        assert!(pieces.waiting.get().is_none(), "all of it is kept");
        assert_eq!(log.newest(&pieces, 5), Some(value));
    }
}

proptest! {
    /// A reader during a write finds either the old or the new value of the item, and all other items unchanged.
    #[test]
    fn the_log_is_read_while_it_is_written(
        puts in prop::collection::vec((0u16..6, any::<i32>()), 0..60),
    ) {
        const KEYS: [u16; 6] = [0, 1, 2, 3, 4, 5];
        let mut cells = Cells::new();
        let mut log = Log::open(&cells);
        let mut kept = [None; 6];
        for (key, value) in puts {
            let place = usize::from(key);
            let mut new = kept;
            new[place] = Some(value);
            for moved in 0.. {
                let (mut write, last) = match log.put(&cells, key, value, moved) {
                    Put::Room(write) => (write, false),
                    Put::Last(write) => (write, true),
                    Put::Full => return Err(TestCaseError::fail("full")),
                };
                while write.step(&mut cells) {
                    let found = find(&log, &cells, &KEYS);
                    prop_assert!(found == kept || found == new, "{found:?}");
                }
                if last {
                    break;
                }
            }
            kept = new;
            prop_assert_eq!(find(&log, &cells, &KEYS), kept);
        }
    }

    /// For any writes, and a power failure at any byte: each item has either its old or its new value.
    #[test]
    fn a_power_cut_leaves_old_or_new(
        before in prop::collection::vec((0u16..6, any::<i32>()), 0..40),
        key in 0u16..6, value: i32, torn: u8, garbage in prop::collection::vec(any::<u8>(), BYTES),
        dirty: bool,
    ) {
        let mut cells = Cells::new();
        if dirty {
            cells.bytes.copy_from_slice(&garbage);
        }
        let mut log = Log::open(&cells);
        let mut kept = HashMap::new();
        for key in 0..6 {
            if let Some(value) = log.newest(&cells, key) {
                kept.insert(key, value);
            }
        }
        for (key, value) in before {
            prop_assert!(put(&mut log, &mut cells, key, value));
            kept.insert(key, value);
        }
        for cut in 1..100 {
            let (mut log, mut cells) = (log, cells.clone());
            (cells.left, cells.torn) = (cut, torn);
            put(&mut log, &mut cells, key, value);
            let finished = cells.left > 0;
            // Power is back.
            cells.left = usize::MAX;
            let mut log = Log::open(&cells);
            for item in 0..6 {
                let found = log.newest(&cells, item);
                let new = item == key && found == Some(value);
                prop_assert!(new || found == kept.get(&item).copied(), "{item} {found:?}");
            }
            // The log still takes records.
            prop_assert!(put(&mut log, &mut cells, key, 1));
            prop_assert_eq!(log.newest(&cells, key), Some(1));
            for (item, value) in &kept {
                prop_assert!(*item == key || log.newest(&cells, *item) == Some(*value));
            }
            if finished {
                break;
            }
        }
    }
}
