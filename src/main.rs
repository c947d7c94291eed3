//! The AVR image. On the host, the command line.
#![cfg_attr(target_arch = "avr", no_std, no_main)]

#[cfg(target_arch = "avr")]
mod image {
    use embassy_executor::raw::Executor;
    use kerf::baud;
    use kerf::hal::imp::{exec, executor, gpio, inputs, panic, time, watchdog};
    use kerf::hal::pender;
    use static_cell::StaticCell;

    // Naming avr-libc and libgcc in the image itself puts them before `compiler_builtins` in the link:
    // see `kerf::math`.
    #[link(name = "c")]
    #[link(name = "m")]
    #[link(name = "gcc")]
    unsafe extern "C" {}

    #[avr_device::entry]
    fn main() -> ! {
        static MAIN: StaticCell<Executor> = StaticCell::new();
        static EXEC: StaticCell<Executor> = StaticCell::new();
        watchdog::begin();
        gpio::start();
        inputs::start();
        let main: &'static Executor = MAIN.init(Executor::new(pender::THREAD));
        let interrupt: &'static Executor = EXEC.init(Executor::new(pender::EXEC));
        if kerf::app::start(main.spawner(), interrupt.spawner(), baud::DEFAULT).is_none() {
            panic::halt();
        }
        time::start();
        exec::start(interrupt);
        watchdog::start();
        executor::run(main)
    }
}

#[cfg(not(target_arch = "avr"))]
mod cli;

#[cfg(not(target_arch = "avr"))]
fn main() -> std::process::ExitCode {
    cli::run()
}
