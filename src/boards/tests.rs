use super::*;

#[test]
fn boards_are_found_by_name() {
    assert!(by_name("ramps14").is_some_and(|b| b.motors[2].step == pin(Port::L, 3)));
    assert!(by_name("nothing").is_none());
}

#[test]
fn a_shared_enable_powers_all() {
    let powered = |board: &Board| [0, 0b0010, 0b1111].map(|wanted| board.powered(wanted));
    assert_eq!(powered(&MEGA2560_GRBL), [0, 0b1111, 0b1111]);
    assert_eq!(powered(&RAMPS14), [0, 0b0010, 0b1111]);
    let both = Board { enable_all: Some(pin(Port::G, 0)), ..RAMPS14 };
    assert_eq!(powered(&both), [0, 0b0010, 0b1111]);
    let neither = Board { enable_all: None, ..MEGA2560_GRBL };
    assert_eq!(powered(&neither), [0b1111; 3]);
}

#[test]
#[should_panic(expected = "pin of this board is used twice")]
fn a_pin_that_is_used_twice_is_refused() {
    let mut board = MEGA2560_GRBL;
    board.enable_all = Some(board.motors[1].step);
    board.check();
}

#[test]
#[should_panic(expected = "pin of this board is used twice")]
fn the_serial_line_is_taken() {
    const TAKEN: &[Pin] = &[pin(Port::E, 1)];
    Board { hazards: TAKEN, ..MEGA2560_GRBL }.check();
}

#[test]
#[should_panic(expected = "pin of this board is used twice")]
fn two_ports_on_one_usart_are_refused() {
    Board { serial: &[USB, USB], ..MEGA2560_GRBL }.check();
}

#[test]
#[should_panic(expected = "beyond port G")]
fn pins_of_ports_are_within_reach() {
    const FAR: Serial = Serial { driver_enable: Some(pin(Port::K, 7)), ..USB };
    Board { serial: &[FAR], ..MEGA2560_GRBL }.check();
}

#[test]
#[should_panic(expected = "not among its hazards")]
fn outputs_are_hazards() {
    Board { hazards: &[], ..MEGA2560_GRBL }.check();
}

#[test]
#[should_panic(expected = "output of this board is used twice")]
fn an_output_that_is_used_twice_is_refused() {
    let mut board = MEGA2560_GRBL;
    board.outputs[1] = board.outputs[0];
    board.check();
}

#[test]
fn both_ends_of_an_axis_may_share_a_pin() {
    let mut board = RAMPS14;
    board.inputs[inputs::Y_MAX] = board.inputs[inputs::Y_MIN];
    board.check();
}

#[test]
#[should_panic(expected = "pin of this board is used twice")]
fn ends_of_two_axes_may_not() {
    let mut board = RAMPS14;
    board.inputs[inputs::Y_MIN] = board.inputs[inputs::X_MAX];
    board.check();
}

#[test]
fn ends_of_axes_share_a_pin_on_an_rp2040() {
    let beside = |ends| PICOBOB.ends_beside(ends);
    assert_eq!([0b11, 0b1100, 0b1_0000, 0].map(beside), [0b11_0011, 0b1100, 0b11_0011, 0]);
    // Ends without a pin are beside nobody.
    assert_eq!(SKR_PICO.ends_beside(0b100_0000), 0b100_0000);
}

#[test]
#[should_panic(expected = "not on pins of its UART")]
fn a_uart_has_its_pins() {
    const OFF: Serial = Serial { usart: Usart::Uart0, pins: Some([gp(9), gp(8)]), ..NATIVE_USB };
    Board { serial: &[NATIVE_USB, OFF], ..PICOHAL }.check();
}

#[test]
#[should_panic(expected = "the pins of this serial port are fixed")]
fn the_pins_of_a_usart_are_fixed() {
    const MOVED: Serial = Serial { pins: Some([pin(Port::A, 0), pin(Port::A, 1)]), ..USB };
    Board { serial: &[MOVED], ..MEGA2560_GRBL }.check();
}

/// A PicoCNC whose register of outputs is another one.
fn registers(outputs: ShiftRegister) -> Board {
    let registers = PICOCNC.registers.map(|both| Registers { outputs, ..both });
    Board { registers, ..PICOCNC }
}

const OUTPUTS: ShiftRegister =
    ShiftRegister { data: gp(17), clock: gp(18), latch: gp(19), outputs: 8 };

#[test]
fn a_register_has_as_many_outputs_as_are_used() {
    registers(OUTPUTS).check();
}

#[test]
#[should_panic(expected = "the register of steps has not eight outputs")]
fn the_register_of_steps_has_eight_outputs() {
    let wide = ShiftRegister { outputs: 16, ..OUTPUTS };
    Board { registers: Some(Registers { steps: wide, outputs: wide }), ..PICOCNC }.check();
}

#[test]
#[should_panic(expected = "has its pins elsewhere")]
fn the_latch_of_a_register_is_behind_its_clock() {
    registers(ShiftRegister { clock: gp(19), latch: gp(18), ..OUTPUTS }).check();
}

#[test]
#[should_panic(expected = "pin of this board is used twice")]
fn the_pins_of_a_register_are_taken() {
    registers(ShiftRegister { data: gp(22), ..OUTPUTS }).check();
}

#[test]
#[should_panic(expected = "is no output of its register")]
fn pins_behind_a_register_are_its_outputs() {
    Board { enable_all: Some(pin(Port::Outputs, 16)), ..PICOCNC }.check();
}

#[test]
#[should_panic(expected = "is no output of its register")]
fn a_board_without_registers_has_no_pins_behind_them() {
    Board { enable_all: Some(pin(Port::Outputs, 0)), ..PICO }.check();
}

#[test]
#[should_panic(expected = "switch of this board cannot interrupt")]
fn a_switch_is_not_behind_a_register() {
    let mut board = PICOCNC;
    board.inputs[inputs::DOOR] = Some(pin(Port::Outputs, 15));
    board.check();
}

#[test]
#[should_panic(expected = "does not invert its output")]
fn a_timer_of_the_mega_does_not_invert() {
    let pwm = MEGA2560_GRBL.pwm.map(|pwm| Pwm { inverted: true, ..pwm });
    Board { pwm, ..MEGA2560_GRBL }.check();
}

#[test]
#[should_panic(expected = "switch of this board cannot interrupt")]
fn a_switch_must_interrupt() {
    let mut board = RAMPS14;
    board.inputs[inputs::A_MIN] = Some(pin(Port::C, 0));
    board.check();
}

#[test]
#[should_panic(expected = "the sensors of this board share a vector")]
fn sensors_have_a_vector_each() {
    let encoder = Some(Encoder { index: pin(Port::K, 1), sync: pin(Port::K, 7), second: None });
    Board { encoder, ..MEGA2560_GRBL }.check();
}

#[test]
#[should_panic(expected = "a sensor of this board cannot interrupt")]
fn sensors_interrupt() {
    let encoder = Some(Encoder { index: pin(Port::L, 1), sync: pin(Port::K, 7), second: None });
    Board { encoder, ..MEGA2560_GRBL }.check();
}

#[test]
#[should_panic(expected = "timer of this board is used twice")]
fn the_spindle_has_a_timer_to_itself() {
    let pwm = Some(Pwm { timer: Timer::T4, channel: 1, inverted: false });
    Board { step_timer: Timer::T4, pwm, ..MEGA2560_GRBL }.check();
}

#[test]
#[should_panic(expected = "output of this board is used twice")]
fn the_pin_of_the_pulses_is_nobody_elses() {
    Board { pwm: Some(Pwm { timer: Timer::T4, channel: 2, inverted: false }), ..MEGA2560_GRBL }
        .check();
}

#[test]
#[should_panic(expected = "timer of this board is used twice")]
fn a_timer_that_is_used_twice_is_refused() {
    Board { tick_timer: Timer::T1, ..MEGA2560_GRBL }.check();
}
