//! Start-up: creates the [`Links`] and the channels, gives each task its ends, then starts the hardware.
//!
//! This code runs on every chip and on the host. What differs between them is in `hal`.

use kerf_macros::small;

#[cfg(feature = "sd")]
use core::cell::RefCell;

use avr_embassy::{Boot, Interrupt, InterruptEnd, Thread, interrupt};
use embassy_executor::Spawner;
use embassy_sync::mutex::Mutex;
use heapless::Vec;

#[cfg(feature = "sd")]
use crate::card::Card;
use crate::config::{Setting, Settings};
use crate::hal::eeprom::Eeprom;
use crate::hal::segments::Segments;
use crate::hal::serial::{AUX, AllEnds, PORTS, Received, USB, hardware};
use crate::hal::{LINE_BYTES, stepper, uart, watchdog};
use crate::motion::blend::Blend;
use crate::motion::queue::{self, BlockQueue, BlockSource, Stage};
use crate::protocol::{Occasion, Remembers, Speech};
use crate::status::Status;
use crate::store::kept;
use crate::store::{Log, Memory as _};
use crate::tasks::common::Common;
use crate::tasks::links::{Earlier, Links};
use crate::tasks::planner::Planner;
use crate::tasks::ports::{AUX_RESERVE, Choice, Port};
use crate::tasks::setup::limit_velocity;
use crate::tasks::storage::Storage;
use crate::tasks::tx::Tx;
use crate::tasks::view::set_hardware;
use crate::tasks::{
    alarm, control, drivers, exec, heat, parser, planner, power, reader, reporter, shaper, spindle,
    storage,
};

/// Size of the line pool of the USB port, in bytes.
const LINES_USB: usize = LINE_BYTES[0];
/// Size of the line pool of the auxiliary port, in bytes.
const LINES_AUX: usize = LINE_BYTES[1];
const _: () = assert!(LINES_AUX >= 80 + AUX_RESERVE as usize);

/// Creates the links in their static place. Not inlined, so that its stack space is free again when it returns.
#[inline(never)]
#[small]
fn place(thread: Thread, ports: [Port; PORTS], earlier: Earlier) -> &'static Links {
    place!(Links, Links::new(thread, ports, earlier))
}

/// Creates what is created before the links.
#[inline(never)]
#[small]
fn place_earlier(thread: Thread) -> Earlier {
    Earlier {
        storage: place!(Storage, Storage::new(thread, Log::open(&Eeprom::of(thread)))),
        #[cfg(feature = "sd")]
        card: place_card(thread),
    }
}

/// Creates the card in its static place. Not inlined, because it takes much of the stack.
#[cfg(feature = "sd")]
#[inline(never)]
#[small]
fn place_card(thread: Thread) -> &'static RefCell<Card> {
    place!(RefCell<Card>, RefCell::new(Card::new(thread)))
}

/// Creates the stage in its static place, if this chip blends. Constant: the stack has no room for another one.
#[inline(never)]
#[small]
fn place_stage() -> Stage {
    core::array::from_fn(|_| place!(Blend, const { Blend::new() }))
}

/// Creates the planner in its static place. The planner task and the parser share it.
#[inline(never)]
#[small]
fn place_planner(links: &'static Links, queue: BlockQueue) -> &'static planner::Shared {
    place!(planner::Shared, Mutex::new(Planner::new(links, queue)))
}

/// Starts the firmware. `main` is the thread-mode executor and `thread` is its token; `boot` shows that nothing runs
/// yet. The exec task has the interrupt executor to itself.
///
/// Call it with interrupts off. Returns `None` if the firmware has been started before.
#[inline(never)]
#[small]
pub fn start(main: Spawner, thread: Thread, boot: &Boot, rate: u32) -> Option<()> {
    let segments = stepper::start(boot)?;
    let queue = queue::store().queue(thread, place_stage())?;
    let (links, received, aux) = connect(thread, boot, rate)?;
    links.report.borrow_mut().restore();
    let occasion = recall(thread, &mut links.settings.borrow_mut(), links.storage);
    set_hardware(thread, &links.settings.borrow());
    spindle::set_all(thread, links.storage);
    heat::set_all(&links.heat, &mut links.settings.borrow_mut(), links.storage);
    links.model.borrow_mut().start(&*links.settings.borrow());
    choose_dialects(links);
    if occasion == Occasion::Defaults {
        alarm::wake_up_in(links, Status::Initializing);
    } else if watchdog::cause().is_fault() {
        alarm::wake_up_in(links, Status::HardReset);
    }
    interrupt::start(|exec_level, level| {
        if let Some(common) = InterruptEnd::of(Common, level)
            && let Some(blocks) = queue::store().source(level)
            && let Ok(task) = exec_task(level, common, blocks, segments)
        {
            exec_level.spawn(task);
        }
    })?;
    main.spawn(reader_task(links, received, aux).ok()?);
    let planner: &'static planner::Shared = place_planner(links, queue);
    main.spawn(planner_task(links, planner).ok()?);
    main.spawn(reporter_task(links, occasion).ok()?);
    main.spawn(power_task(links).ok()?);
    main.spawn(parser_task(links, planner).ok()?);
    main.spawn(control_task(links).ok()?);
    main.spawn(storage_task(links).ok()?);
    Some(())
}

/// Sets the dialect of each port. A port whose settings leave the choice to the sender takes the dialect of the first
/// lines that arrive.
#[inline(never)]
#[small]
fn choose_dialects(links: &Links) {
    let settings = links.settings.borrow();
    for port in &links.ports {
        port.speech.set(Speech::at_start(&settings, port.number));
        port.choice.set(match Speech::IS_CHOSEN {
            false => Choice::None,
            true if settings.lets_senders_choose(port.number) => Choice::Open,
            true => Choice::Set,
        });
    }
    links.decided(&settings);
}

/// A simulated machine on the host that runs the firmware.
#[cfg(feature = "std")]
impl crate::hal::imp::Machine {
    /// Creates the machine and boots the firmware at `baud`. A thread can have one machine; for a second one this
    /// returns `None`.
    pub fn boot(baud: u32) -> Option<Self> {
        Self::boot_at(baud, 0)
    }

    /// Creates the machine and boots the firmware at `baud`. The millisecond count begins at `ms`, so that tests can
    /// make it wrap. Returns `None` for a second machine in a thread.
    pub fn boot_at(baud: u32, ms: u64) -> Option<Self> {
        Self::start(ms, |main, thread, boot| start(main, thread, boot, baud))
    }
}

/// Starts the ports and creates the links. Not inlined, for the reason given at [`place()`].
#[inline(never)]
#[small]
fn connect(
    thread: Thread,
    boot: &Boot,
    rate: u32,
) -> Option<(&'static Links, Received, Option<Received>)> {
    let earlier = place_earlier(thread);
    let AllEnds { usb: (received, outgoing), aux } = uart::start(thread, boot, rate)?;
    let mut ports = Vec::<Port, PORTS>::new();
    ports
        .push(Port::new(USB, line_bytes!(LINES_USB), Tx::new(thread, outgoing, USB, rate)))
        .ok()?;
    let aux = match (aux, hardware(AUX)) {
        (Some((received, outgoing)), Some(board)) if PORTS > 1 => {
            let tx = Tx::new(thread, outgoing, AUX, board.rate);
            ports.push(Port::new(AUX, line_bytes!(LINES_AUX), tx)).ok()?;
            Some(received)
        }
        _ => None,
    };
    Some((place(thread, ports.into_array().ok()?, earlier), received, aux))
}

/// Sets all settings to their defaults, then loads those that EEPROM holds. Returns `Occasion::Defaults` if the log in
/// EEPROM, or a part of it, is unreadable.
#[inline(never)]
fn recall(thread: Thread, settings: &mut Settings, storage: &Storage) -> Occasion {
    let (log, memory) = (storage.log(), Eeprom::of(thread));
    settings.set_defaults();
    storage.resume(kept::load(&log, &memory, settings));
    // Power may have failed between a setting and the velocities that it has lowered.
    if limit_velocity(settings, Setting::MACHINE) {
        storage.note_at_start();
    }
    drivers::recall(settings, storage);
    shaper::recall(settings, storage);
    match memory.is_lost() || log.is_rubbish(&memory) {
        true => Occasion::Defaults,
        false => Occasion::Ready,
    }
}

tasks! {
    fn exec_task(
        level: Interrupt,
        common: InterruptEnd<Common>,
        blocks: BlockSource,
        segments: Segments
    ) = exec::run;
    fn reader_task(
        links: &'static Links,
        usb: Received,
        aux: Option<Received>
    ) = reader::run;
    fn planner_task(links: &'static Links, planner: &'static planner::Shared) = planner::run;
    fn reporter_task(links: &'static Links, occasion: Occasion) = reporter::run;
    fn control_task(links: &'static Links) = control::run;
    fn power_task(links: &'static Links) = power::run;
    fn parser_task(links: &'static Links, planner: &'static planner::Shared) = parser::run;
    fn storage_task(links: &'static Links) = storage::run;
}
