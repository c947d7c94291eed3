//! Interrupt vectors of the ATmega2560, by number.

use kerf::boards::Timer;

/// Vectors there are, reset included.
pub const COUNT: usize = 57;

/// Names as in the data sheet.
#[rustfmt::skip]
const NAMES: [&str; COUNT] = [
    "RESET", "INT0", "INT1", "INT2", "INT3", "INT4", "INT5", "INT6", "INT7", "PCINT0", "PCINT1",
    "PCINT2", "WDT", "TIMER2_COMPA", "TIMER2_COMPB", "TIMER2_OVF", "TIMER1_CAPT", "TIMER1_COMPA",
    "TIMER1_COMPB", "TIMER1_COMPC", "TIMER1_OVF", "TIMER0_COMPA", "TIMER0_COMPB", "TIMER0_OVF",
    "SPI_STC", "USART0_RX", "USART0_UDRE", "USART0_TX", "ANALOG_COMP", "ADC", "EE_READY",
    "TIMER3_CAPT", "TIMER3_COMPA", "TIMER3_COMPB", "TIMER3_COMPC", "TIMER3_OVF", "USART1_RX",
    "USART1_UDRE", "USART1_TX", "TWI", "SPM_READY", "TIMER4_CAPT", "TIMER4_COMPA", "TIMER4_COMPB",
    "TIMER4_COMPC", "TIMER4_OVF", "TIMER5_CAPT", "TIMER5_COMPA", "TIMER5_COMPB", "TIMER5_COMPC",
    "TIMER5_OVF", "USART2_RX", "USART2_UDRE", "USART2_TX", "USART3_RX", "USART3_UDRE", "USART3_TX",
];

/// The name of a vector.
pub fn name(vector: u8) -> &'static str {
    NAMES.get(usize::from(vector)).copied().unwrap_or("?")
}

/// The vector of a timer's compare match A.
pub fn compare_a(timer: Timer) -> u8 {
    match timer {
        Timer::T0 => 21,
        Timer::T1 => 17,
        Timer::T2 => 13,
        Timer::T3 => 32,
        Timer::T4 => 42,
        Timer::T5 => 47,
    }
}
