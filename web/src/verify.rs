//! Checks a real board: the checks of `tests/verify`, as a conversation with the page.
//!
//! The checks are one future over [`Wire`], a board that does nothing itself: it puts what it wants into a queue, and
//! the page does it. [`Verification::step`] is called from `web/page/verify.js` only. It takes the time and what the
//! board has sent, polls the future at most once, and returns the next [`Want`]. The future is polled with a waker that
//! does nothing, because the page calls again in any case.
//!
//! A page flashes nothing, so the self-test image does not take part, and the report says so. Each wait of the checks
//! has a limit. A port that fails makes every later want an error, and so ends the checks.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::future::poll_fn;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use kerf_verify::{Board, Dialect, Image, Plan, Report, verify};

/// Seconds over which clocks are compared. In grbl's dialect a dwell is answered when it is over, and no answer may take
/// ten seconds.
const SECONDS: u32 = 10;
/// What the report calls the board: a port does not tell its name.
const BOARD: &str = "a board behind Web Serial";
/// What the report says of the checks that a page cannot make.
const LIMITS: &str = "Only Kerf itself was checked, because a page flashes nothing. `cargo xtask verify` checks the \
                      chip, too.";

/// What the checks want of the page.
pub enum Want {
    /// To be called when bytes have come, at the latest at this time.
    Wait(Duration),
    /// To send bytes.
    Send(Vec<u8>),
    /// To reset the board.
    Reset,
    /// To tell the person a line.
    Tell(String),
    /// Nothing more.
    Done(Report),
}

impl Want {
    /// Returns the want for the page: a byte that says which it is, and its contents. A time is an `f64`, ms. A report
    /// is one byte, 1 if the board is sound, its verdict, a line end, and the file.
    pub fn bytes(self) -> Vec<u8> {
        let (kind, contents) = match self {
            Want::Wait(until) => (0, (until.as_secs_f64() * 1e3).to_le_bytes().to_vec()),
            Want::Send(bytes) => (1, bytes),
            Want::Reset => (2, Vec::new()),
            Want::Tell(line) => (3, line.into_bytes()),
            Want::Done(report) => (4, told(&report)),
        };
        [vec![kind], contents].concat()
    }
}

fn told(report: &Report) -> Vec<u8> {
    let text = format!("{}\n{report}\n{LIMITS}\n", report.verdict());
    [vec![report.is_sound().into()], text.into_bytes()].concat()
}

/// What the page and the checks share.
#[derive(Default)]
struct Shared {
    now: Cell<Duration>,
    heard: RefCell<Vec<u8>>,
    wants: RefCell<VecDeque<Want>>,
    /// Why the port does not work any more.
    broken: RefCell<Option<String>>,
}

impl Shared {
    fn want(&self, want: Want) {
        self.wants.borrow_mut().push_back(want);
    }

    fn works(&self) -> Result<(), String> {
        self.broken.borrow().clone().map_or(Ok(()), Err)
    }
}

/// The board, as the checks see it.
struct Wire(Rc<Shared>);

impl Wire {
    /// Returns when the page has done what is wanted.
    async fn ask(&self, want: Want) -> Result<(), String> {
        self.0.works()?;
        self.0.want(want);
        let mut is_done = false;
        poll_fn(|_| match std::mem::replace(&mut is_done, true) {
            true => Poll::Ready(()),
            false => Poll::Pending,
        })
        .await;
        self.0.works()
    }
}

impl Board for Wire {
    /// A page flashes nothing: Kerf is on the board already.
    async fn flash(&mut self, _: Image) -> Result<(), String> {
        self.reset().await
    }

    async fn reset(&mut self) -> Result<(), String> {
        self.ask(Want::Reset).await
    }

    /// Only the self-test image has other rates.
    async fn set_rate(&mut self, _: u32) -> Result<(), String> {
        Err("a page keeps the rate of its port".into())
    }

    async fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.ask(Want::Send(bytes.to_vec())).await
    }

    async fn receive(&mut self, until: Duration) -> Result<Vec<u8>, String> {
        loop {
            self.0.works()?;
            let heard = self.0.heard.take();
            if !heard.is_empty() || self.now() >= until {
                return Ok(heard);
            }
            self.ask(Want::Wait(until)).await?;
        }
    }

    fn now(&self) -> Duration {
        self.0.now.get()
    }

    fn tell(&mut self, what: &str) {
        self.0.want(Want::Tell(what.to_owned()));
    }
}

type Checks = Pin<Box<dyn Future<Output = Report>>>;

/// The checks of a board.
pub struct Verification {
    shared: Rc<Shared>,
    /// `None` when the report has been returned.
    checks: Option<Checks>,
}

impl Verification {
    /// Prepares the checks. `seed` chooses the values that are stored.
    pub fn new(dialect: &'static Dialect, seed: u64) -> Self {
        let plan = Plan {
            board: BOARD.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            dialect,
            clock_hz: None,
            static_end: None,
            jumpers: None,
            seconds: SECONDS,
            seed,
        };
        let shared = Rc::<Shared>::default();
        let mut wire = Wire(shared.clone());
        let checks: Checks = Box::pin(async move { verify(&mut wire, &plan).await });
        Verification { shared, checks: Some(checks) }
    }

    /// Goes on. The page has done what was wanted last, it is `now`, and these bytes have come since. Returns what is
    /// wanted next; `None` behind the report.
    pub fn step(&mut self, now: Duration, heard: &[u8]) -> Option<Want> {
        self.shared.now.set(now);
        self.shared.heard.borrow_mut().extend(heard);
        if self.shared.wants.borrow().is_empty() {
            self.poll();
        }
        self.shared.wants.borrow_mut().pop_front()
    }

    fn poll(&mut self) {
        let Some(checks) = &mut self.checks else { return };
        if let Poll::Ready(report) = checks.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            self.shared.want(Want::Done(report));
            self.checks = None;
        }
    }

    /// The port does not work from now on.
    pub fn fail(&mut self, why: &str) {
        self.shared.broken.borrow_mut().get_or_insert_with(|| why.to_owned());
    }
}

#[cfg(test)]
mod tests {
    use kerf_verify::Outcome;
    use kerf_verify::dialect::TINYG;

    use super::*;

    /// Runs the checks in simulated time, with these answers to what is sent. Returns the report and the time.
    fn run(mut act: impl FnMut(&Want, &mut Verification) -> Vec<u8>) -> (Report, Duration) {
        let mut checks = Verification::new(&TINYG, 1);
        let (mut now, mut heard) = (Duration::ZERO, Vec::new());
        loop {
            let want = checks.step(now, &std::mem::take(&mut heard)).unwrap();
            heard = act(&want, &mut checks);
            match want {
                Want::Wait(until) if heard.is_empty() => now = until,
                Want::Done(report) => {
                    assert!(checks.step(now, b"").is_none(), "behind the report");
                    return (report, now);
                }
                _ => {}
            }
        }
    }

    fn count(report: &Report, outcome: Outcome) -> usize {
        report.findings().iter().filter(|one| one.outcome == outcome).count()
    }

    #[test]
    fn a_board_that_is_silent_ends_the_checks() {
        let (report, took) = run(|_, _| Vec::new());
        assert_eq!(count(&report, Outcome::Failed), 1, "{report}");
        assert!(took < Duration::from_secs(20), "{took:?}");
    }

    #[test]
    fn a_port_that_fails_ends_the_checks_at_once() {
        let (report, took) = run(|want, checks| match want {
            Want::Reset => b"{\"r\":{\"msg\":\"SYSTEM READY\"},\"f\":[1,0,0]}\n".to_vec(),
            Want::Send(_) => {
                checks.fail("unplugged");
                Vec::new()
            }
            _ => Vec::new(),
        });
        let failed = report.findings().iter().find(|one| one.outcome == Outcome::Failed);
        assert_eq!(failed.unwrap().measured, "unplugged");
        assert!(count(&report, Outcome::Sound) == 0 && took < Duration::from_secs(2), "{report}");
    }

    #[test]
    fn a_want_is_a_byte_and_its_contents() {
        assert_eq!(Want::Send(b"x".to_vec()).bytes(), b"\x01x");
        assert_eq!(Want::Reset.bytes(), [2]);
        let wait = Want::Wait(Duration::from_millis(1_500)).bytes();
        assert_eq!(wait[1..], 1_500.0_f64.to_le_bytes());
        let (report, _) = run(|_, _| Vec::new());
        let done = Want::Done(report).bytes();
        let text = String::from_utf8(done[2..].to_vec()).unwrap();
        assert!(done[..2] == [4, 0] && text.contains("FAILED"), "{text}");
        assert!(text.ends_with("checks the chip, too.\n"), "{text}");
    }
}
