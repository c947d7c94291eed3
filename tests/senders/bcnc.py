"""bCNC: bcnc.py PORT JOB CONTROLLER, where CONTROLLER is GRBL1 or G2Core."""

import sys
import time

from steps import PLATE, ensure, main, session, step, until  # first: redirects what bCNC prints
from bcnc_sender import Bcnc, VERSION

PORT, JOB, CONTROLLER = sys.argv[1:]
GRBL = CONTROLLER == "GRBL1"
FAR = 40

bcnc = Bcnc(PORT, CONTROLLER)


def state():
    return bcnc.get("state").split(":")[0]


def x():
    return bcnc.get("mx")


def idle_at(place):
    return until(lambda: state() == "Idle" and abs(x() - place) < 0.0005)


def hear():
    """Returns a function that finds the first line from the board, from now on, with a given beginning and end."""
    begin = len(bcnc.heard)
    return lambda text, end="": next(
        (line for line in bcnc.heard[begin:] if line.startswith(text) and line.endswith(end)), None
    )


def ask(line, answer):
    heard = hear()
    bcnc.sendGCode(line)
    return until(lambda: heard(answer))


def connect():
    """Opens the port, which resets the board, as DTR does. The board finds the dialect by itself."""
    bcnc.openClose()
    if GRBL:
        until(lambda: state() == "Idle")
        # The greeting has passed before bCNC listens.
        heard = hear()
        bcnc.softReset()
        until(lambda: heard("Grbl 1.1h"))
        bcnc.viewBuild()
        return f"{until(lambda: heard('[VER:'))}, controller {bcnc.controller}"
    # bCNC does not remove XOFF from lines, so flow control is switched off.
    ask('{"EX":0}', '{"r":{"ex":0}')
    bcnc.viewState()
    until(lambda: state() == "Idle")
    return f"state {state()}, controller {bcnc.controller}, flow control off"


def close():
    bcnc.openClose()
    ensure(bcnc.serial is None, "it is open")
    time.sleep(0.3)  # The simulated board checks from time to time whether the port is open.
    return "port closed"


def setting(value=None):
    """Reads the highest velocity of X, or sets it first."""
    if value is not None:
        ask(f"$110={value}" if GRBL else f'{{"XVM":{value}}}', "ok" if GRBL else '{"r":{"xvm":')
    if GRBL:
        bcnc.put("grbl_110", "")
        bcnc.viewSettings()
        return float(until(lambda: bcnc.get("grbl_110")))
    return float(ask('{"XVM":null}', '{"r":{"xvm":').split(":")[2].split("}")[0])


def settings():
    before = setting()
    ensure(setting(700) == 700, "the new value is not taken")
    close()
    connect()
    ensure(setting() == 700, "the new value is not kept")
    ensure(setting(before) == before, "the old value is not taken")
    return f"{before}, written 700, kept over a reset, written back"


def jog():
    bcnc.mcontrol.jog("X2")
    idle_at(2)
    bcnc.mcontrol.jog("X-2")
    idle_at(0)
    return "X by 2 mm and back"


def slide(name, value):
    """Moves a slider, and repeats that until the machine has the value. bCNC counts from the last report, so with an
    old report it ends at another value."""
    bcnc.put(f"_Ov{name}", value)
    moved = 0

    def is_there():
        nonlocal moved
        if bcnc.get(f"Ov{name}") == value:
            return True
        if time.monotonic() - moved > 2:
            moved = time.monotonic()
            bcnc.put("_OvChanged", True)
        return False

    until(is_there)


def overrides():
    """Moves bCNC's sliders one at a time, because it forgets the others. It sends characters above 7F in UTF-8, as two
    bytes."""
    for name, value in [("Feed", 113), ("Rapid", 50), ("Spindle", 88), ("Feed", 100), ("Rapid", 100), ("Spindle", 100)]:
        slide(name, value)
    return "113, 50, 88 % and back"


def home():
    if GRBL:
        for axis in "XYZ":
            ask(f"$H{axis}", "ok")
    else:
        ask("G28.2 X0 Y0 Z0", '{"r":')
    until(lambda: state() == "Idle")
    place = [bcnc.get(name) for name in ("mx", "my", "mz")]
    ensure(place == [0, 0, 0], f"at {place}")
    return f"at {place}"


def probe():
    heard = hear()
    bcnc.sendGCode("G38.2 Z-70 F800")
    if GRBL:
        # bCNC's own `$#` also lists the last contact, so a line without contact may come first.
        at = float(until(lambda: heard("[PRB:", ":1]")).split(",")[2].split(":")[0])
    else:
        at = until(lambda: heard('{"prb":') or heard('{"r":{"prb":'))
        at = float(at.split('"z":')[1].split(",")[0].split("}")[0])
    ensure(abs(at - PLATE) < 0.01, f"at {at}")
    until(lambda: state() == "Idle")
    return f"contact at {at}"


def stop():
    """Presses the button "Stop" in the middle of a long move: a hold, and then a reset."""
    # Z moves up from the plate, as a user would do first.
    bcnc.sendGCode("G90 G0 Z0")
    until(lambda: state() == "Idle" and abs(bcnc.get("mz")) < 0.0005)
    bcnc.start([f"G1 X{FAR} F60", "G1 X0"])
    until(lambda: state() == "Run" and x() > 1)
    bcnc.stopRun()
    ensure(not bcnc.running, "it runs on")
    until(lambda: state() == "Idle" and bcnc.queue.empty())
    there = x()
    ensure(1 < there < FAR, f"at {there}")
    time.sleep(0.5)
    ensure(x() == there, f"it has moved on from {there} to {x()}")
    bcnc.sendGCode("G0 X0")
    idle_at(0)
    return f"at X {there} of {FAR}, back at 0"


def start():
    del bcnc.errors[:]
    bcnc.load(JOB)
    return f"{bcnc.start()} lines"


def not_refused():
    ensure(not bcnc.errors, f"it is told {bcnc.errors[:1]}")
    return True


def hold():
    until(lambda: not_refused() and bcnc._gcount > bcnc._runLines / 10 and state() == "Run")
    bcnc.pause()
    until(lambda: bcnc.get("state") == ("Hold:0" if GRBL else "Hold"))
    place = lambda: [bcnc.get(name) for name in ("mx", "my", "mz")]
    if not GRBL:
        time.sleep(1)
    there = place()
    time.sleep(1)
    ensure(there == place() and state() == "Hold", "it moves in hold")
    bcnc.resume()
    until(lambda: state() == "Run")
    return f"stands in {'Hold:0' if GRBL else 'Hold'}, goes on"


def finish():
    """Waits for the end of the job. bCNC may consider the job ended before the machine is idle."""
    lines = bcnc._runLines
    until(lambda: not_refused() and not bcnc.running)
    until(lambda: state() == "Idle")
    place = [bcnc.get(name) for name in ("mx", "my", "mz")]
    return f"{lines} counted, {state()} at {place}"


def test():
    step("start", 60, lambda: f"bCNC {VERSION}, Python {sys.version.split()[0]}")
    session(
        connect=connect,
        settings=settings,
        jog=jog,
        overrides=overrides if GRBL else None,
        home=home,
        probe=probe,
        stop=stop,
        close=close,
        start=start,
        hold=hold,
        finish=finish,
    )


main(test)
