//! The entry point of the image. On the host, the entry point of the command line.
#![cfg_attr(target_os = "none", no_std, no_main)]

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

#[cfg(all(target_arch = "arm", target_os = "none"))]
mod image {
    use avr_embassy::Executor;
    use kerf::baud;
    use kerf::hal::event;
    use kerf::hal::imp::{self, panic};
    use static_cell::StaticCell;

    #[cortex_m_rt::entry]
    fn main() -> ! {
        static MAIN: StaticCell<Executor> = StaticCell::new();
        imp::begin();
        MAIN.init(Executor::new()).run_with(
            |main, thread| {
                if kerf::app::start(main, thread, baud::DEFAULT).is_none() {
                    panic::halt();
                }
                imp::start();
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
