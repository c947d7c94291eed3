//! Words and decimal numbers.

use super::serial::send;

/// Most digits of a number from the host.
const DIGITS: usize = 7;

/// Reads the next word as a number. `Some(None)` if there is no word, `None` if it is no number.
pub fn number<'a>(words: &mut impl Iterator<Item = &'a [u8]>) -> Option<Option<u32>> {
    match words.next() {
        None => Some(None),
        Some(word) => value(word).map(Some),
    }
}

fn value(word: &[u8]) -> Option<u32> {
    if word.is_empty() || word.len() > DIGITS {
        return None;
    }
    let digit = |byte: &u8| byte.is_ascii_digit().then(|| u32::from(byte - b'0'));
    word.iter().try_fold(0, |value, byte| Some(value * 10 + digit(byte)?))
}

/// Sends an answer: its name, and numbers.
#[inline(never)]
pub fn answer(name: &[u8], numbers: &[u32]) {
    name.iter().for_each(|byte| send(*byte));
    for number in numbers {
        send(b' ');
        put(*number);
    }
    send(b'\n');
}

/// Sends a number.
fn put(number: u32) {
    let (mut digits, mut rest) = ([0; 10], number);
    let mut length = 0;
    for digit in &mut digits {
        *digit = b'0' + (rest % 10) as u8;
        rest /= 10;
        length += 1;
        if rest == 0 {
            break;
        }
    }
    digits.iter().take(length).rev().for_each(|digit| send(*digit));
}
