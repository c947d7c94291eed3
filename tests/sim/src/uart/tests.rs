use super::*;
use crate::chip::ATMEGA2560;

const BASE: u16 = 0xC0;
/// 117647 baud at 16 MHz, as near to 115200 as it gets.
const BIT: u64 = 136;
const BYTE: u64 = 10 * BIT;

fn uart() -> Uart {
    let mut u = Uart::new(ATMEGA2560.usarts[0]);
    u.write(BASE, U2X, 0);
    u.write(BASE + UBRRL, 16, 0);
    u.write(BASE + UCSRB, RXEN | TXEN | RXC, 0);
    u
}

fn receive(u: &mut Uart, bytes: &[u8]) -> u64 {
    let mut now = 1000;
    for byte in bytes {
        u.start_bit(*byte, BIT as f64, now);
        now += BYTE;
        u.advance(now);
    }
    now
}

#[test]
fn a_frame_is_ten_bits() {
    let mut u = uart();
    u.write(BASE + UDR, b'a', 100);
    assert_eq!(u.due(), 100 + BYTE);
    u.write(BASE + UDR, b'b', 110);
    assert_eq!(u.read(BASE, 120).unwrap() & UDRE, 0, "both places taken");
    u.advance(100 + 2 * BYTE);
    assert_eq!(u.take_sent(), Some((100 + BYTE, b'a')));
    assert_eq!(u.take_sent(), Some((100 + 2 * BYTE, b'b')));
    assert_eq!(u.read(BASE, 5000).unwrap() & (UDRE | TXC), UDRE | TXC);
}

#[test]
fn a_byte_is_there_in_its_stop_bit() {
    let mut u = uart();
    u.start_bit(b'x', BIT as f64, 1000);
    assert_eq!(u.due(), 1000 + BYTE - BIT / 2);
    assert_eq!(u.lines(), 0);
    u.advance(u.due());
    assert_eq!(u.lines(), 1 << 25);
    assert_eq!(u.read(BASE + UDR, 3000), Some(b'x'));
    assert_eq!(u.lines(), 0);
}

#[test]
fn three_bytes_wait_and_the_fourth_start_bit_costs_one() {
    let mut u = uart();
    let now = receive(&mut u, b"abc");
    assert_eq!(u.overruns(), 0);
    u.start_bit(b'd', BIT as f64, now);
    assert_eq!(u.overruns(), 1);
    u.advance(now + BYTE);
    let mut read = || {
        let lost = u.read(BASE, now + BYTE).unwrap() & DOR != 0;
        (u.read(BASE + UDR, now + BYTE).unwrap(), lost)
    };
    let all = [read(), read(), read()];
    assert_eq!(
        all,
        [(b'a', false), (b'b', false), (b'd', true)],
        "told with the byte behind the loss"
    );
    assert_eq!(u.read(BASE, now + BYTE).unwrap() & (DOR | RXC), 0);
}

#[test]
fn the_empty_transmitter_is_a_level() {
    let mut u = Uart::new(ATMEGA2560.usarts[3]);
    assert_eq!(u.lines(), 0);
    u.write(0x131, TXEN | UDRE, 0);
    assert_eq!(u.lines(), 1 << 55);
    u.acknowledge(55);
    assert_eq!(u.lines(), 1 << 55, "service alone does not clear it");
    u.write(0x131, TXEN, 0);
    assert_eq!(u.lines(), 0);
}

#[test]
fn a_frame_error_is_of_its_byte() {
    let mut u = uart();
    u.start_bit(b'a', BIT as f64, 0);
    u.start_bit(b'b', BIT as f64, BYTE);
    u.break_frame();
    u.start_bit(b'c', BIT as f64, 2 * BYTE);
    u.advance(2 * BYTE);
    let read = |u: &mut Uart, now| (u.read(BASE, now).unwrap() & FE != 0, u.read(BASE + UDR, now));
    assert_eq!(read(&mut u, 2 * BYTE), (false, Some(b'a')));
    assert_eq!(read(&mut u, 2 * BYTE), (true, Some(b'b')));
    u.advance(3 * BYTE);
    assert_eq!(read(&mut u, 3 * BYTE), (false, Some(b'c')));
    assert_eq!(u.misframed(), 1);
}

#[test]
fn a_receiver_at_another_speed_reads_rubbish() {
    let mut u = uart();
    u.start_bit(b'a', 2.0 * BIT as f64, 0);
    u.advance(BYTE);
    assert_eq!(u.misframed(), 1);
    assert_ne!(u.read(BASE + UDR, BYTE), Some(b'a'));
}

/// The limits of the data sheet, tables 22-2 and 22-3: 96.00 and 103.90 % at double speed, else 95.36 and 104.58 %.
#[test]
fn a_receiver_understands_senders_within_the_limits_of_the_data_sheet() {
    for (mode, slowest, fastest) in [(U2X, 0.9600, 1.0390), (0, 0.9536, 1.0458)] {
        let mut u = uart();
        u.write(BASE, mode, 0);
        let mut reads = |speed: f64| {
            let before = u.misframed();
            u.start_bit(b'a', u.bit_cycles() as f64 / speed, 0);
            u.receiving = None;
            u.misframed() == before
        };
        for (speed, is_read) in [
            (slowest - 0.0002, false),
            (slowest + 0.0002, true),
            (fastest - 0.0002, true),
            (fastest + 0.0002, false),
        ] {
            assert_eq!(reads(speed), is_read, "mode {mode}, {speed}");
        }
    }
}
