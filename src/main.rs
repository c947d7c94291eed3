//! The entry point of the image. On the host, the entry point of the command line.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(feature = "chip-atmega2560")]
mod image {
    use avr_embassy::{Boot, Executor};
    use kerf::baud;
    use kerf::hal::event;
    use kerf::hal::imp::{gpio, inputs, panic, time, watchdog};
    use static_cell::StaticCell;

    kerf::link_libraries!();

    #[avr_device::entry]
    fn main() -> ! {
        static MAIN: StaticCell<Executor> = StaticCell::new();
        // SAFETY: nothing runs yet, and `run_with` drops the token with the closure before it polls a task.
        let boot = unsafe { Boot::assume() };
        watchdog::begin(&boot);
        gpio::start(&boot);
        inputs::start(&boot);
        MAIN.init(Executor::new()).run_with(
            move |main, thread| {
                if kerf::app::start(main, thread, &boot, baud::DEFAULT).is_none() {
                    panic::halt();
                }
                time::start(&boot);
                watchdog::start(&boot);
            },
            event::turn,
        )
    }
}

#[cfg(feature = "chip-rp2040")]
mod image {
    use avr_embassy::{Boot, Executor};
    use kerf::baud;
    use kerf::hal::event;
    use kerf::hal::imp::{self, panic};
    use static_cell::StaticCell;

    #[cortex_m_rt::entry]
    fn main() -> ! {
        static MAIN: StaticCell<Executor> = StaticCell::new();
        // SAFETY: nothing runs yet, and `run_with` drops the token with the closure before it polls a task.
        let boot = unsafe { Boot::assume() };
        imp::begin(&boot);
        MAIN.init(Executor::new()).run_with(
            move |main, thread| {
                if kerf::app::start(main, thread, &boot, baud::DEFAULT).is_none() {
                    panic::halt();
                }
                imp::start(&boot);
            },
            event::turn,
        )
    }
}

#[cfg(not(target_os = "none"))]
mod cli;

#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    cli::run()
}
