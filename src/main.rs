//! The AVR image. On the host, the command line.
#![cfg_attr(target_arch = "avr", no_std, no_main)]

#[cfg(target_arch = "avr")]
mod image {
    use avr_embassy::Executor;
    use kerf::baud;
    use kerf::hal::event;
    use kerf::hal::imp::{gpio, inputs, panic, time, watchdog};
    use static_cell::StaticCell;

    kerf::link_libraries!();

    #[avr_device::entry]
    fn main() -> ! {
        static MAIN: StaticCell<Executor> = StaticCell::new();
        watchdog::begin();
        gpio::start();
        inputs::start();
        MAIN.init(Executor::new()).run_with(
            |main, thread| {
                if kerf::app::start(main, thread, baud::DEFAULT).is_none() {
                    panic::halt();
                }
                time::start();
                watchdog::start();
            },
            event::turn,
        )
    }
}

#[cfg(not(target_arch = "avr"))]
mod cli;

#[cfg(not(target_arch = "avr"))]
fn main() -> std::process::ExitCode {
    cli::run()
}
