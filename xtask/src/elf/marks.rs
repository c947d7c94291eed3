//! Refuses an image with three times `!` in a row. Boot loaders of 2011 take these bytes, wherever they are in an image,
//! for the command that opens a monitor, so such an image cannot be flashed.

use anyhow::{Result, bail};

use super::{Image, Symbol};

/// What these loaders take for a command.
const MARK: &[u8] = b"!!!";

/// Checks the parts of an image that are written to flash, each with its address.
pub fn check(image: &Image, parts: &[(u64, Vec<u8>)]) -> Result<()> {
    let Some(at) = find(parts) else { return Ok(()) };
    let before = image.symbols.iter().rev().find(|symbol| symbol.address <= at);
    let name = before.map_or("no symbol", |Symbol { name, .. }| name);
    bail!(
        "{} has three bytes 0x21, `!!!`, in a row at {at:#x}, in {name}: boot loaders of 2011 take them for a command, \
         and cannot flash this image",
        image.path.display()
    );
}

/// Returns the address of the first mark, which may lie across two parts that touch.
fn find(parts: &[(u64, Vec<u8>)]) -> Option<u64> {
    let mut bytes: Vec<(u64, u8)> =
        parts.iter().flat_map(|(start, part)| (*start..).zip(part.iter().copied())).collect();
    bytes.sort();
    let is_mark = |window: &&[(u64, u8)]| {
        (0..).zip(*window).all(|(n, (at, byte))| *at == window[0].0 + n && MARK.contains(byte))
    };
    bytes.windows(MARK.len()).find(is_mark).map(|window| window[0].0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_marks_in_a_row_are_found() {
        let part = |at, text: &str| (at, text.as_bytes().to_vec());
        assert_eq!(find(&[part(0x100, "a!!b!! !")]), None);
        assert_eq!(find(&[part(0x100, "a!!!!")]), Some(0x101));
        assert_eq!(
            find(&[part(0x105, "!"), part(0x100, "abc!!")]),
            Some(0x103),
            "across two parts"
        );
        assert_eq!(
            find(&[part(0x106, "!"), part(0x100, "abc!!")]),
            None,
            "with a gap between them"
        );
    }

    #[test]
    fn the_error_names_the_place() {
        let symbol =
            |name: &str, address| Symbol { name: name.into(), address, size: 0, is_data: true };
        let symbols = vec![symbol("FIRST", 0), symbol("TABLE", 0x100), symbol("LAST", 0x200)];
        let image = Image { path: "k.elf".into(), sizes: super::super::Sizes::default(), symbols };
        let error = check(&image, &[(0x100, b"a!!!".to_vec())]).unwrap_err().to_string();
        assert!(
            error.starts_with("k.elf has three bytes 0x21, `!!!`, in a row at 0x101, in TABLE: "),
            "{error}"
        );
        assert!(check(&image, &[(0x100, b"a!!".to_vec())]).is_ok());
    }
}
