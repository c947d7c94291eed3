"""plotdeck's machine controller, without its window: plot-deck.py PORT JOB"""

import sys
import time

# First, because it redirects what the library prints.
from steps import MANY, PLATE, contact, ensure, kept, main, stands, started, until, whole_session
from plotdeck.core.controller import MachineController
from plotdeck.core.streamer import StreamerState

PORT, JOB = sys.argv[1:]
FAR = 40

deck = MachineController()
heard = []
errors = []
listed = []
ended = []
deck.on_line = lambda kind, line: (heard.append(line), print("<", line))
deck.on_sent = lambda line: print(">", line)
deck.on_command_error = lambda code, text: errors.append(f"error:{code} {text}")
deck.on_stream_error = lambda line, code, text: errors.append(f"{line.text}: error:{code} {text}")
deck.on_port_error = errors.append
deck.on_settings = listed.extend
deck.on_job_finished = ended.append


def state():
    return deck.status.state


def x():
    return deck.status.mpos[0]


def idle_at(place):
    until(lambda: not_refused() and state() == "Idle" and abs(x() - place) < 0.0005)


def not_refused():
    ensure(not errors, errors)
    return True


def hear(begin):
    first = len(heard)
    return lambda: next((line for line in heard[first:] if line.startswith(begin)), None)


def do(done):
    """Does what a button does, and waits for its answer."""
    begin = len(heard)
    ensure(done(), "the button does nothing")
    until(lambda: not_refused() and "ok" in heard[begin:])


def connect():
    """Opens the port. plotdeck reads positions of three numbers only, so its console switches a fourth axis off."""
    report = hear("<")
    deck.connect(PORT)
    until(lambda: deck.connected and report() and state() == "Idle")
    do(deck.request_info)
    # It accepts exactly three numbers.
    until(lambda: deck.status.mpos)
    return f"firmware {deck.firmware}, at {deck.status.mpos}"


def close():
    deck.disconnect()
    time.sleep(0.3)  # The simulated board checks from time to time whether the port is open.
    return "port closed"


def setting():
    del listed[:]
    deck.request_settings()
    return float(next(entry.value for entry in until(lambda: listed) if entry.number == 110))


def settings():
    return kept(setting, lambda value: do(lambda: deck.set_setting(110, value)), close, connect)


def jog():
    do(lambda: deck.jog("X", 2))
    idle_at(2)
    do(lambda: deck.jog("X", FAR, 60))
    until(lambda: state() == "Jog" and x() > 3)
    deck.jog_cancel()
    until(lambda: state() == "Idle")
    ensure(x() < FAR, f"at {x()}")
    there = x()
    do(lambda: deck.goto_zero("X"))
    idle_at(0)
    return f"X by 2 mm, cancelled at {there} of {FAR + 2}, back at 0"


def home():
    do(deck.home)
    until(lambda: state() == "Idle")
    return f"at {deck.status.mpos}"


def probe():
    said = hear("[PRB:")
    do(lambda: deck.probe_z(plate_thickness=10, feed=800, travel=70))
    result = contact(until(said))
    until(lambda: state() == "Idle" and abs(deck.status.mpos[2] - PLATE - 5) < 0.01 and deck.status.wco[2] != 0)
    ensure(abs(deck.status.wpos[2] - 15) < 0.01, f"zero is wrong: {deck.status.raw}")
    for line in ["G10 L2 P1 Z0", "G90 G0 Z0"]:
        do(lambda line=line: deck.send_line(line))
    return f"{result}, zero set 10 mm below, retracted by 5 mm"


def in_move():
    del ended[:]
    greeting = hear("Grbl")
    ensure(deck.run_text("\n".join(["G90", f"G1 X{FAR} F60", *MANY])), "the job does not start")
    until(lambda: state() == "Run" and x() > 1)
    return greeting


def unlocked(greeting):
    until(lambda: greeting() and ended and state() in ("Alarm", "Idle"))
    before = state()
    if before == "Alarm":
        do(deck.unlock)
    until(lambda: state() == "Idle")
    there = x()
    ensure(1 < there < FAR, f"at {there}")
    do(lambda: deck.goto_zero("X"))
    idle_at(0)
    return f"{before}, job {ended}, at X {there} of {FAR}, back at 0"


def cancel():
    """Presses "Stop": a hold and at once a reset."""
    greeting = in_move()
    deck.stop()
    return unlocked(greeting)


def reset():
    greeting = in_move()
    deck.soft_reset()
    return unlocked(greeting)


def start():
    del ended[:]
    with open(JOB, encoding="ascii") as job:
        ensure(deck.run_text(job.read()), "the job does not start")
    return f"{deck.streamer.total} lines, counting characters"


def hold():
    until(lambda: not_refused() and deck.streamer.sent > deck.streamer.total / 10 and state() == "Run")
    detailed = lambda: f"{state()}:{deck.status.substate}" if deck.status.substate else state()
    # When all lines have been answered the job counts as done, and the buttons for the machine itself are left.
    buttons = (deck.pause, deck.resume) if deck.streamer.is_active else (deck.hold, deck.cycle_start)
    return stands(*buttons, detailed, lambda: deck.status.mpos)


def finish():
    until(lambda: not_refused() and ended)
    until(lambda: state() == "Idle")
    ensure(deck.streamer.state == StreamerState.COMPLETED, deck.streamer.state)
    return f"{deck.streamer.sent} lines answered, {deck.status.raw}"


def test():
    started("plotdeck")
    whole_session(
        connect=connect,
        settings=settings,
        jog=jog,
        home=home,
        probe=probe,
        cancel=cancel,
        reset=reset,
        close=close,
        start=start,
        hold=hold,
        finish=finish,
    )


main(test)
