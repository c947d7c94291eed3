//! The ATmega1284P. The ATmega1284 and ATmega644P have the same registers, and the same vectors up to those of
//! USART1.
//!
//! The tick is on timer 0. The software interrupt is USART1's data-register-empty. That transmitter never sends, so
//! the condition of the interrupt always holds, and its enable bit raises or withdraws it. The transmitter is on,
//! which keeps port D bit 3 high. USART1's receiver is free. SPM_READY is a level-triggered interrupt as well and
//! takes no pin, but its register must not be written while the EEPROM is being written.

/// GPIOR0.
pub const FLAGS: u8 = 0x1E;
/// UCSR1B.
pub const PEND: usize = 0xC9;
/// TXEN1 and UDRIE1.
pub const PENDED: u8 = 1 << 3 | 1 << 5;
/// TXEN1.
pub const WITHDRAWN: u8 = 1 << 3;
/// SMCR.
pub const SMCR: usize = 0x53;
/// SE, with the mode bits 0: idle.
pub const SLEEP_IDLE: u8 = 1;
/// TCCR0A.
pub const TCCRA: usize = 0x44;
/// TCCR0B.
pub const TCCRB: usize = 0x45;
/// OCR0A.
pub const OCRA: usize = 0x47;
/// TIMSK0.
pub const TIMSK: usize = 0x6E;
/// CS02 to CS00.
pub const PRESCALERS: [(u8, u32); 4] = [(2, 8), (3, 64), (4, 256), (5, 1024)];

// TIMER0_COMPA and USART1_UDRE.
handlers!(tick: __vector_16, software: __vector_29);
