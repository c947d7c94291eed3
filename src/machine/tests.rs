//! Tests every event in every state: against tables in this file, with the functions of the image, and for general
//! properties.

use avr_embassy::host::Runtime;
use std::collections::BTreeSet;
use std::vec::Vec;

use super::*;

/// The state after an event for each [`Hold`], in their order. `-` means that the state stays.
const HOLD: [(Event, &str); 14] = [
    //                     O R H D F f X x K k
    (Event::Hold, /*     */ "H H - - - - - - - -"),
    (Event::Resume, /*   */ "- - R - - - - - - -"),
    (Event::Flush, /*    */ "F F F f - - - - - -"),
    (Event::Cut, /*      */ "X X X x X x - - - -"),
    (Event::Kill, /*     */ "K K K k K k K k - -"),
    (Event::Dropped, /*  */ "- - - - - - O D O D"),
    (Event::DoorOpened, /**/ "D D D - f - x - k -"),
    (Event::DoorShut, /* */ "- - - H - F - X - K"),
    (Event::DoorShutIdle, "- - - O - F - X - K"),
    (Event::Rested, /*   */ "- O - - - - - - - -"),
    (Event::Alarm, /*    */ "X X X x X x - - - -"),
    (Event::Limit, /*    */ "X X X x X x - - - -"),
    (Event::Shutdown, /* */ "X X X x X x - - - -"),
    (Event::Panic, /*    */ "X X X x X x - - - -"),
];

/// The letters of the holds in [`HOLD`]. A lower-case letter means that the door is open.
const LETTERS: &str = "ORHDFfXxKk";

/// The state after an event for each [`Cycle`], in their order (lines, stopped, probe, homing, jog, check), while
/// nothing is dropped and there is no alarm.
const CYCLE: [(Event, &str); 7] = [
    (Event::Stopped, "S S S S S S"),
    (Event::Probe, "P P P P P P"),
    (Event::Homing, "H H H H H H"),
    (Event::Jog, "J J J J J J"),
    (Event::Check, "C C C C C C"),
    (Event::Done, "- L L L L L"),
    (Event::Dropped, "- L L L L -"),
];

/// The state after an event for each [`Alarm`], in their order (none, alarm, limit, shutdown, panic), while nothing is
/// flushed.
const ALARM: [(Event, &str); 5] = [
    (Event::Alarm, "A - - - -"),
    (Event::Limit, "L L - - -"),
    (Event::Shutdown, "S S S - -"),
    (Event::Panic, "P P P P -"),
    (Event::Cleared, "- N N N -"),
];

/// Returns the state that `table` gives for an event in state `at`. `letters` are the letters of the states of this
/// part.
fn row(table: &[(Event, &str)], letters: &str, event: Event, at: usize) -> usize {
    let Some((_, row)) = table.iter().find(|(of, _)| *of == event) else { return at };
    let to = row.split(' ').nth(at).unwrap();
    if to == "-" { at } else { letters.find(to).unwrap() }
}

/// Returns the state that the tables give for an event.
fn written(state: State, event: Event) -> State {
    let State { alarm, hold, cycle } = state;
    let counts = match event {
        Event::Alarm => alarm < Alarm::Alarm,
        Event::Limit => alarm < Alarm::Limit,
        Event::Shutdown => alarm < Alarm::Shutdown,
        Event::Panic => alarm < Alarm::Panic,
        _ => true,
    };
    let flushes = !matches!(hold, Hold::Off | Hold::Resuming | Hold::Held | Hold::Door);
    let drops = flushes && !matches!(hold, Hold::Flush | Hold::FlushDoor);
    let is_refused = match event {
        Event::Stopped | Event::Probe | Event::Homing | Event::Jog | Event::Check => {
            drops || alarm != Alarm::None
        }
        Event::Done => drops,
        Event::Cleared => flushes,
        _ => !counts,
    };
    if is_refused {
        return state;
    }
    State {
        alarm: Alarm::ALL[row(&ALARM, "NALSP", event, alarm as usize)],
        hold: Hold::ALL[row(&HOLD, LETTERS, event, hold as usize)],
        cycle: Cycle::ALL[row(&CYCLE, "LSPHJC", event, cycle as usize)],
    }
}

fn all() -> impl Iterator<Item = State> {
    let regions = |alarm| {
        Hold::ALL
            .into_iter()
            .flat_map(move |hold| Cycle::ALL.map(|cycle| State { alarm, hold, cycle }))
    };
    Alarm::ALL.into_iter().flat_map(regions)
}

/// Returns every state that the machine can reach by any sequence of events.
fn reachable() -> BTreeSet<State> {
    let mut reached = BTreeSet::from([State::START, State::AFTER_FAULT]);
    let mut new = Vec::from_iter(reached.iter().copied());
    while let Some(state) = new.pop() {
        new.extend(
            Event::ALL.map(|event| state.after(event)).into_iter().filter(|to| reached.insert(*to)),
        );
    }
    reached
}

/// Returns the state of this thread's machine.
fn now() -> State {
    State { alarm: alarm(), hold: Hold::ALL[usize::from(hold_byte().get())], cycle: cycle() }
}

fn set(state: State) {
    alarm_byte().set(state.alarm as u8);
    hold_byte().set(state.hold as u8);
    cycle_byte().set(state.cycle as u8);
}

/// Raises an event as the tasks do.
fn happen(runtime: &Runtime, event: Event) {
    let (thread, exec) = (runtime.thread(), runtime.interrupt());
    match event {
        Event::Dropped => {
            dropped(thread);
        }
        Event::Rested => {
            rested(exec);
        }
        Event::Stopped | Event::Probe | Event::Homing | Event::Jog | Event::Check | Event::Done => {
            carry_out(thread, event)
        }
        Event::Cleared => {
            clear(thread);
        }
        _ => match event.alarm() {
            Some(alarm) => {
                raise(thread, alarm, || ());
            }
            None => take(thread, event),
        },
    }
}

#[test]
fn every_event_in_every_state() {
    let runtime = Runtime::new();
    for (state, event) in all().flat_map(|state| Event::ALL.map(|event| (state, event))) {
        let expected = written(state, event);
        assert_eq!(state.after(event), expected, "{event:?} in {state:?}");
        set(state);
        happen(&runtime, event);
        assert_eq!(now(), expected, "the image's functions: {event:?} in {state:?}");
    }
}

#[test]
fn questions_are_those_of_the_state() {
    for state in all() {
        set(state);
        let hold = state.hold;
        assert_eq!(is_held(), hold.holds(), "{hold:?}");
        assert_eq!(is_flushing(), hold.flushes(), "{hold:?}");
        assert_eq!(is_dropping(), hold.drops(), "{hold:?}");
        assert_eq!(is_killing(), hold.kills(), "{hold:?}");
        assert_eq!(is_to_cut(), hold.flushes() && !hold.drops(), "{hold:?}");
        assert_eq!(has_open_door(), "Dfxk".contains(LETTERS.as_bytes()[hold as usize] as char));
        assert_eq!(may_resume(), !hold.flushes() && !has_open_door(), "{hold:?}");
        assert_eq!(is_resuming(), hold == Hold::Resuming);
        assert_eq!(goes_on(), matches!(hold, Hold::Off | Hold::Resuming));
        assert_eq!(is_stopped(), state.cycle == Cycle::Stopped);
        assert_eq!(is_checking(), state.cycle == Cycle::Check);
        assert_eq!(is_alarmed(), state.alarm != Alarm::None);
        assert_eq!(is_locked(), state.alarm.is_on() && !hold.drops());
        assert_eq!((alarm(), cycle()), (state.alarm, state.cycle));
    }
}

#[test]
fn one_word_says_what_the_machine_is_doing() {
    for (state, works) in all().flat_map(|state| [(state, false), (state, true)]) {
        set(state);
        // A program stop is reported as rest, and so is a kill at standstill.
        let moves = works && state.cycle != Cycle::Stopped;
        let expected = match (state.alarm, LETTERS.as_bytes()[state.hold as usize], state.cycle) {
            (Alarm::None, b'R' | b'H' | b'F' | b'X', _) => Doing::Holds,
            (Alarm::None, b'D' | b'f' | b'x', _) => Doing::Door,
            (Alarm::None, b'K', _) if moves => Doing::Holds,
            (Alarm::None, b'k', _) if moves => Doing::Door,
            (Alarm::None, _, Cycle::Probe) => Doing::Probes,
            (Alarm::None, _, Cycle::Homing) => Doing::Homes,
            (Alarm::None, _, Cycle::Jog) => Doing::Jogs,
            // In check mode nothing is carried out.
            (Alarm::None, _, Cycle::Check) => Doing::Rests,
            (Alarm::None, _, _) if moves => Doing::Runs,
            (Alarm::None, _, _) => Doing::Rests,
            (alarm, _, _) => Doing::Alarm(alarm),
        };
        assert_eq!(doing(|| works), expected, "{state:?}");
        let is_seen = state.hold.holds() && (moves || !state.hold.kills());
        assert_eq!(shows_hold(|| works), is_seen, "{state:?}");
    }
}

#[test]
fn in_an_alarm_nothing_is_carried_out_that_was_not_before_it() {
    for state in reachable().into_iter().filter(|state| state.alarm.is_on()) {
        let lasts = matches!(state.cycle, Cycle::Lines | Cycle::Check);
        assert!(lasts || state.hold.drops(), "{state:?}");
        for event in Event::ALL {
            let after = state.after(event);
            assert!(
                after.cycle == Cycle::Lines || after.cycle == state.cycle,
                "{event:?} in {state:?}"
            );
            assert!(after.alarm.is_on() || event == Event::Cleared, "{event:?} in {state:?}");
        }
    }
}

#[test]
fn exec_carries_nothing_out_in_an_alarm_before_the_queue_has_been_dropped() {
    let is_locked = |state: State| state.alarm.is_on() && !state.hold.drops();
    for state in reachable().into_iter().filter(|state| !is_locked(*state)) {
        for event in Event::ALL.into_iter().filter(|event| *event != Event::Dropped) {
            assert!(!is_locked(state.after(event)), "{event:?} in {state:?}");
        }
    }
}

#[test]
fn an_alarm_gets_worse_or_is_cleared_and_a_panic_stays() {
    for (state, event) in
        reachable().into_iter().flat_map(|state| Event::ALL.map(|event| (state, event)))
    {
        let after = state.after(event);
        let is_cleared = event == Event::Cleared && state.alarm != Alarm::Panic;
        assert!(after.alarm >= state.alarm || (is_cleared && after.alarm == Alarm::None));
        // Each alarm drops the queue before it may end.
        assert!(after.alarm <= state.alarm || after.hold.drops(), "{event:?} in {state:?}");
        assert!(!state.alarm.is_on() || after.alarm.is_on() || !state.hold.flushes());
    }
}

#[test]
fn a_flush_goes_on_to_its_end_and_ends() {
    for state in reachable().into_iter().filter(|state| state.hold.flushes()) {
        for event in Event::ALL {
            let after = state.after(event);
            let ends = event == Event::Dropped && state.hold.drops();
            assert!(after.hold.flushes() || ends, "{event:?} in {state:?}");
            assert!(after.hold.drops() || !state.hold.drops() || ends, "{event:?} in {state:?}");
            assert!(after.hold.kills() || !state.hold.kills() || ends, "{event:?} in {state:?}");
        }
        // The reader drops the lines, then the planner drops the queue.
        let end = state.after(Event::Cut).after(Event::Dropped);
        let cycle = if state.cycle == Cycle::Check { Cycle::Check } else { Cycle::Lines };
        assert_eq!(end, State { alarm: state.alarm, cycle, hold: end.hold });
        assert!(matches!(end.hold, Hold::Off | Hold::Door), "{state:?}");
    }
}

#[test]
fn motion_goes_on_by_what_lets_it_alone() {
    for (state, event) in
        reachable().into_iter().flat_map(|state| Event::ALL.map(|event| (state, event)))
    {
        let after = state.after(event);
        if state.hold.holds() && !after.hold.holds() {
            let lets = match event {
                Event::Rested => state.hold == Hold::Resuming,
                Event::Dropped => state.hold.drops(),
                Event::DoorShutIdle => state.hold == Hold::Door,
                _ => false,
            };
            assert!(
                lets && !state.hold.has_open_door() || event == Event::DoorShutIdle,
                "{event:?} in {state:?}"
            );
        }
        if after.hold == Hold::Resuming && state.hold != Hold::Resuming {
            assert_eq!((event, state.hold), (Event::Resume, Hold::Held));
        }
        // Only the events of a shut door close the door.
        let shuts = matches!(event, Event::DoorShut | Event::DoorShutIdle);
        assert!(
            !state.hold.has_open_door() || shuts || after.hold.has_open_door(),
            "{event:?} in {state:?}"
        );
    }
}

#[test]
fn exec_may_write_while_thread_mode_takes_an_event() {
    // Between a read and a write by thread mode, exec may change the state from `Resuming` to `Off`.
    for event in Event::ALL.into_iter().filter(|event| *event != Event::Rested) {
        let (before, after) = (Hold::Resuming.after(event), Hold::Off.after(event));
        let is_written = before != Hold::Resuming;
        assert!(if is_written { before == after } else { after == Hold::Off }, "{event:?}");
    }
}

#[test]
fn what_can_be_reached() {
    let reached = reachable();
    let without = all().filter(|state| !state.alarm.is_on()).collect::<BTreeSet<_>>();
    assert!(without.is_subset(&reached), "without an alarm each hold is possible in each cycle");
    // In an alarm, each cycle is possible while the queue is dropped. With any other hold only `Lines` and `Check` are.
    let alarmed = 4 * (4 * 6 + 6 * 2);
    assert_eq!(reached.len(), without.len() + alarmed);
}

#[test]
fn discriminants_are_places_in_the_lists() {
    assert!(Event::ALL.iter().enumerate().all(|(n, event)| *event as usize == n));
    assert!(Hold::ALL.iter().enumerate().all(|(n, hold)| *hold as usize == n));
    assert!(
        Cycle::ALL
            .iter()
            .enumerate()
            .all(|(n, cycle)| Cycle::from_bits(n as u8) == *cycle && *cycle as usize == n)
    );
    assert!(
        Alarm::ALL
            .iter()
            .enumerate()
            .all(|(n, alarm)| Alarm::from_bits(n as u8) == *alarm && *alarm as usize == n)
    );
    let of_hold = Event::ALL.iter().filter(|event| **event as usize >= Event::OF_HOLD);
    assert!(of_hold.clone().all(|event| *event == Event::Rested
        || event.alarm().is_some()
        || Hold::ALL.iter().all(|hold| hold.after(*event) == *hold)));
}
