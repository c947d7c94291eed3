//! `cargo xtask verify` at an emulated board with USB of its own.

use std::time::Duration;

use embassy_futures::block_on;
use kerf::boards::PICO;
use kerf_sim::emulated::Emulated;
use kerf_sim::{Runs, USB};
use kerf_verify::{Dialect, Image as Which, Outcome, Plan, dialect, verify};

use crate::common::image;

/// Time between two looks for bytes, ms.
const SLICE_MS: u64 = 1;

/// The board, and the computer at the other end of its cable.
struct Pico(Emulated);

impl Pico {
    fn seconds(&self) -> f64 {
        self.0.cycle() as f64 / self.0.cycles(1_000) as f64
    }
}

impl kerf_verify::Board for Pico {
    /// The board has Kerf already.
    async fn flash(&mut self, _: Which) -> Result<(), String> {
        self.reset().await
    }

    async fn reset(&mut self) -> Result<(), String> {
        self.0.reset();
        self.0.receive_from(USB);
        Ok(())
    }

    async fn set_rate(&mut self, _: u32) -> Result<(), String> {
        Err("USB has no rate".into())
    }

    async fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.0.send_to(USB, bytes);
        Ok(())
    }

    async fn receive(&mut self, until: Duration) -> Result<Vec<u8>, String> {
        loop {
            let bytes = self.0.receive_from(USB);
            if !bytes.is_empty() || self.now() >= until {
                return Ok(bytes);
            }
            self.0.run_for_ms(SLICE_MS).map_err(|fault| fault.to_string())?;
        }
    }

    fn now(&self) -> Duration {
        Duration::from_secs_f64(self.seconds())
    }

    fn tell(&mut self, _: &str) {}
}

fn plan(dialect: &'static Dialect) -> Plan {
    Plan {
        board: PICO.name.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        dialect,
        clock_hz: None,
        static_end: None,
        jumpers: None,
        seconds: 1,
        seed: 1,
    }
}

/// All but the chip is checked, and has no finding.
#[test]
#[ignore = "needs the emulator"]
fn kerf_on_a_pico_has_no_finding() {
    let mut pico = Pico(Emulated::load(&image(&PICO), &PICO).unwrap());
    let report = block_on(verify(&mut pico, &plan(&dialect::TINYG)));
    let sound = report.findings().iter().filter(|one| one.outcome == Outcome::Sound).count();
    assert!(report.is_sound() && sound == 6, "{report}");
}
