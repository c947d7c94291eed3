"""The steps of a test of a sender in Python. They are reported as in `steps.js`, a line each: `step`, `passed`, `failed`
or `not offered`, the name and details, separated by tabs."""

import importlib.metadata
import os
import sys
import threading
import time

# Output of the sender itself goes to standard error, because it is not a step.
_out = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)


def tell(result, name, details):
    print("step", result, name, " ".join(str(details).split()), sep="\t", file=_out, flush=True)


class Late(Exception):
    """A step exceeds its time limit."""


_end = None


def step(name, seconds, run):
    """Runs a step and reports its result. The details that it returns are for people."""
    global _end
    _end = time.monotonic() + seconds
    watchdog = threading.Timer(seconds + 10, _give_up, [name])
    watchdog.daemon = True
    watchdog.start()
    try:
        details = run()
    except Late:
        tell("failed", name, f"not done within {seconds} s")
        leave(1)
    except BaseException as error:  # pylint: disable=broad-except
        tell("failed", name, f"{type(error).__name__}: {error}")
        leave(1)
    watchdog.cancel()
    tell("passed", name, details)


def started(package):
    """Reports which version of the sender is tested. A sender that is not installed fails here."""
    step("start", 10, lambda: f"{package} {importlib.metadata.version(package)}, Python {sys.version.split()[0]}")


def until(condition):
    """Waits until the condition holds. The time limit of the step ends a wait that would never end."""
    while not (value := condition()):
        if time.monotonic() > _end:
            raise Late
        time.sleep(0.01)
    return value


def ensure(condition, text):
    if not condition:
        raise AssertionError(text)


def kept(read, write, close, connect):
    """Stores another value of a setting, checks that it is kept over a reset, and stores the value of before."""
    before = read()
    write("700")
    close()
    connect()
    ensure(read() == 700, "the new value is not kept")
    write(f"{before:.3f}")
    ensure(read() == before, "the old value is not taken")
    return f"{before}, written 700, kept over a reset, written back"


def stands(pause, resume, state, place):
    """Pauses, checks that the machine stands for a second, and resumes."""
    pause()
    until(lambda: state() in ("Hold", "Hold:0"))
    there = place()
    time.sleep(1)
    ensure(state() in ("Hold", "Hold:0") and place() == there, "it moves in hold")
    resume()
    until(lambda: state() == "Run")
    return f"stands in Hold at {there}, goes on"


# Lines of a job that no board takes whole into its queue.
MANY = ["G1 X1", "G1 X0"] * 1500

# The position of the plate when Z has been homed at its top.
PLATE = -51.8


def contact(line):
    """Checks the result of a probing, such as `[PRB:0.000,0.000,-51.800:1]`, and returns it."""
    z = float(line.replace(":", ",").split(",")[3])
    ensure(abs(z - PLATE) < 0.01 and line.endswith(":1]"), line)
    return line


_stop = None


def main(test, stop=None):
    """Runs the test and ends the process. The process also ends when its standard input ends, because then no program
    waits for it any more. `stop` ends what the test has started, however the process ends."""
    global _stop
    _stop = stop
    watcher = threading.Thread(target=lambda: (sys.stdin.read(), leave(1)), daemon=True)
    watcher.start()
    test()
    leave(0)


def session(*, connect, settings, jog, home, probe, stop, close, start, hold, finish, overrides=None):
    """Runs the steps that every sender has, from the first connection to the end of the job, with a reconnection."""
    step("connect", 20, connect)
    step("settings", 180, settings)
    step("jog", 180, jog)
    if overrides:
        step("override", 180, overrides)
    step("home", 180, home)
    step("probe", 180, probe)
    step("stop", 180, stop)
    step("close", 20, close)
    step("reconnect", 20, connect)
    step("stream", 20, start)
    step("hold", 120, hold)
    step("finish", 600, finish)
    step("close", 20, close)


def whole_session(*, connect, close, start, finish, hold=None, design=None, **offered):
    """Runs all steps, with two reconnections. `offered` and `hold` are the steps that a sender may lack; a missing one is
    reported as not offered. `design` runs a job that the sender itself draws, `cancel` ends a job, and `reset` resets the
    board in the middle of a move."""
    step("connect", 60, connect)
    for name in ["settings", "jog", "home", "probe"]:
        maybe(name, 180, offered.pop(name, None))
    if design:
        step("design", 180, design)
    for name in ["cancel", "reset"]:
        maybe(name, 180, offered.pop(name, None))
    ensure(not offered, f"no step is called {list(offered)}")
    for _ in range(2):
        step("close", 30, close)
        step("reconnect", 60, connect)
    step("stream", 30, start)
    maybe("hold", 120, hold)
    step("finish", 600, finish)
    step("close", 30, close)


def maybe(name, seconds, run):
    """Runs a step if the sender has a function for it."""
    if run:
        step(name, seconds, run)
    else:
        tell("not offered", name, "")


def leave(code):
    """Ends the process without waiting for threads of the sender."""
    _out.flush()
    if _stop:
        _stop()
    os._exit(code)


def _give_up(name):
    tell("failed", name, "it hangs")
    leave(1)
