//! Refuses an image that is in the way of the boot loader: see [`shrink::restart`](crate::shrink::restart).

use anyhow::{Result, ensure};

use super::Image;
use crate::shrink::restart::CALLED;

/// A jump to 0.
pub const JUMP: [u8; 4] = [0x0C, 0x94, 0, 0];

/// Checks the parts of an image that are written to flash, each with its address. An image that ends before the place
/// need not have the jump.
pub fn check(image: &Image, parts: &[(u64, Vec<u8>)]) -> Result<()> {
    let has_it = is_restarted(parts);
    ensure!(
        has_it,
        "{} has no jump to 0 at {CALLED:#x}, where the boot loader goes after a reset by the watchdog",
        image.path.display()
    );
    Ok(())
}

fn is_restarted(parts: &[(u64, Vec<u8>)]) -> bool {
    let byte = |at: u64| {
        parts
            .iter()
            .find_map(|(start, part)| part.get(usize::try_from(at.checked_sub(*start)?).ok()?))
    };
    let found = [0, 1, 2, 3].map(|n| byte(u64::from(CALLED) + n));
    found.iter().all(Option::is_none) || found == JUMP.each_ref().map(Some)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_has_the_jump_or_ends_before_it() {
        let called = u64::from(CALLED);
        assert!(is_restarted(&[(0, vec![1; CALLED as usize])]));
        assert!(is_restarted(&[(0, vec![1; 9]), (called, JUMP.to_vec())]));
        let mut whole = vec![1; CALLED as usize];
        whole.extend(JUMP);
        assert!(is_restarted(&[(0, whole.clone())]));
        whole.insert(0, 1);
        assert!(!is_restarted(&[(0, whole)]));
        assert!(!is_restarted(&[(0, vec![1; CALLED as usize + 2])]));
    }
}
