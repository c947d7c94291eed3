use super::*;

const TCCR1B: u16 = 0x81;
const TCNT1: u16 = 0x84;
const OCR1A: u16 = 0x88;
const TIFR1: u16 = 0x36;
const TIMSK1: u16 = 0x6F;
const CTC: u8 = 1 << 3;
const BY_1: u8 = 1;
const BY_8: u8 = 2;
const COMPARE_A: u8 = 1 << 1;

fn timer1() -> Timer {
    Timer::new(&ATMEGA2560[1])
}

fn write_word(t: &mut Timer, addr: u16, value: u16, now: u64) {
    t.write(addr + 1, (value >> 8) as u8, now);
    t.write(addr, value as u8, now);
}

fn read_word(t: &mut Timer, addr: u16, now: u64) -> u16 {
    let low = t.read(addr, now).unwrap();
    u16::from_le_bytes([low, t.read(addr + 1, now).unwrap()])
}

/// Returns the cycle at which the flag of compare match A goes up. The other channels match at 0.
fn match_a(t: &mut Timer) -> u64 {
    while t.flags & COMPARE_A == 0 {
        t.advance(t.due());
    }
    t.last_event()
}

#[test]
fn ctc_repeats_every_top_plus_one() {
    let mut t = timer1();
    write_word(&mut t, OCR1A, 99, 0);
    t.write(TIMSK1, COMPARE_A, 0);
    t.write(TCCR1B, CTC | BY_1, 1000);
    for period in 1..=3 {
        let at = match_a(&mut t);
        assert_eq!((at, t.lines()), (1000 + 100 * period, 1 << 17));
        t.acknowledge(17, at);
        assert_eq!(t.lines(), 0);
    }
}

#[test]
fn the_prescaler_runs_freely() {
    let mut t = timer1();
    write_word(&mut t, OCR1A, 9, 0);
    t.write(TCCR1B, CTC | BY_8, 1005);
    // Counts fall on multiples of 8 cycles, whenever the timer was started.
    assert_eq!(match_a(&mut t), 1000 + 80);
}

#[test]
fn a_stopped_timer_keeps_its_count_and_starts_from_it() {
    let mut t = timer1();
    write_word(&mut t, TCNT1, 500, 10);
    t.write(TCCR1B, BY_1, 1000);
    t.write(TCCR1B, 0, 1100);
    assert_eq!(read_word(&mut t, TCNT1, 9000), 600);
    t.write(TCCR1B, BY_8, 16_000);
    assert_eq!(read_word(&mut t, TCNT1, 16_080), 610);
}

#[test]
fn a_flag_waits_while_masked() {
    let mut t = timer1();
    write_word(&mut t, OCR1A, 99, 0);
    t.write(TCCR1B, CTC | BY_1, 0);
    t.advance(1000);
    assert_eq!(t.lines(), 0);
    t.write(TIMSK1, COMPARE_A, 1000);
    assert_eq!(t.lines(), 1 << 17);
    t.write(TIFR1, COMPARE_A, 1001);
    assert_eq!((t.lines(), t.due()), (0, 1100));
}

#[test]
fn a_top_behind_the_counter_costs_a_wrap() {
    let mut t = timer1();
    write_word(&mut t, OCR1A, 999, 0);
    t.write(TCCR1B, CTC | BY_1, 0);
    write_word(&mut t, OCR1A, 99, 500);
    assert_eq!(t.missed(), 1);
    let compare = |t: &mut Timer, now| t.read(TIFR1, now).unwrap() & COMPARE_A;
    assert_eq!(compare(&mut t, 65_536 + 99), 0);
    assert_eq!(compare(&mut t, 65_536 + 100), COMPARE_A);
}

#[test]
fn writing_the_counter_blocks_one_match() {
    let mut t = timer1();
    write_word(&mut t, OCR1A, 50, 0);
    t.write(TCCR1B, CTC | BY_1, 0);
    write_word(&mut t, TCNT1, 50, 20);
    // 50 for one count, then 0 to 50, and the flag after that.
    assert_eq!(match_a(&mut t), 20 + 52);
}

#[test]
fn pwm_compare_values_wait_for_the_wrap() {
    let mut t = Timer::new(&ATMEGA2560[0]);
    let (tccr0a, tccr0b, ocr0b, tifr0) = (0x44, 0x45, 0x48, 0x35);
    t.write(tccr0a, 3, 0);
    t.write(tccr0b, BY_1, 0);
    t.write(ocr0b, 20, 100);
    t.write(tifr0, 0xFF, 110);
    assert_eq!(t.read(tifr0, 255).unwrap() & 4, 0);
    assert_eq!(t.read(tifr0, 256 + 21).unwrap() & 5, 5);
}
