"""The library pygrbl-streamer: pygrbl-streamer.py PORT JOB"""

import sys
import threading
import time

# First, because it redirects what the library prints.
from steps import MANY, contact, ensure, kept, main, stands, started, until, whole_session
from pygrbl_streamer import GrblStreamer, State

PORT, JOB = sys.argv[1:]
FAR = 40

heard = []
errors = []
grbl = GrblStreamer(PORT)
grbl.receive_callback = lambda line: (heard.append(line), print("<", line))
grbl.send_callback = lambda data: print(">", repr(data))
grbl.error_callback = errors.append
job = None


def state():
    return grbl.last_status["raw"][1:].split("|")[0]


def place():
    return [float(n) for n in grbl.last_status["raw"].split("MPos:")[1].split("|")[0].split(",")]


def ask():
    """Asks for a status report and waits for it. During a job only this driver asks, because the library does not."""
    before = grbl.last_status.get("time")
    grbl.realtime(b"?")
    until(lambda: grbl.last_status.get("time") != before)
    return state()


def idle_at(x):
    until(lambda: ask() == "Idle" and abs(place()[0] - x) < 0.0005)


def send(line, timeout=60):
    ensure(grbl.command(line, timeout), f"{line} is answered by {errors or heard[-1:]}")


def connect():
    grbl.connect()
    ensure(grbl.state == State.IDLE, grbl.state)
    return f"greeted, {ask()}"


def close():
    grbl.disconnect()
    time.sleep(0.3)  # The simulated board checks from time to time whether the port is open.
    return "port closed"


def setting():
    begin = len(heard)
    send("$$")
    return float(until(lambda: [line for line in heard[begin:] if line.startswith("$110=")])[0].split("=")[1])


def settings():
    return kept(setting, lambda value: send(f"$110={value}"), close, connect)


def jog():
    for way, there in [(2, 2), (-2, 0)]:
        send(f"$J=G91 X{way} F600")
        idle_at(there)
    return "X by 2 mm and back"


def home():
    ensure(grbl.home(wait_idle=True), f"{heard[-3:]}")
    return f"{ask()} at {place()}"


def probe():
    begin = len(heard)
    send("G38.2 Z-70 F800")
    result = contact(until(lambda: [line for line in heard[begin:] if line.startswith("[PRB:")])[0])
    send("G0 Z0")
    return result


def stream(run):
    """Runs a job on a thread of its own, because the library sends it on the caller's."""
    global job
    del errors[:]
    job = threading.Thread(target=lambda: setattr(job, "result", run()), daemon=True)
    job.start()


def in_move():
    stream(lambda: grbl.stream([f"G1 X{FAR} F60", *MANY]))
    until(lambda: ask() == "Run" and place()[0] > 1)


def ended(again):
    """Waits for the end of the stopped job. Then unlocks, and goes back."""
    job.join()
    ensure(not job.result, "the job counts as done")
    ask()
    there = place()[0]
    ensure(1 < there < FAR, f"at {there}")
    again()
    ensure(ask() == "Idle" and place()[0] == there, f"{state()} at {place()}")
    grbl.sync()
    send("G0 X0")
    idle_at(0)
    return f"at X {there} of {FAR}, back at 0"


def cancel():
    in_move()
    grbl.stop()
    return ended(grbl.unlock)


def reset():
    in_move()
    ensure(grbl.reset(), heard[-3:])
    return ended(lambda: None)


def start():
    stream(lambda: grbl.send_file(JOB))
    until(lambda: ask() == "Run")
    return "counting characters"


def hold():
    with open(JOB, "rb") as file:
        lines = len(file.readlines())
    begin = len(heard)
    until(lambda: len(heard) > begin + lines / 10 and ask() == "Run")
    return stands(grbl.pause, grbl.resume, ask, place)


def finish():
    until(lambda: not job.is_alive())
    ensure(job.result and not errors, f"it is told {errors[:1]}")
    return f"{ask()} at {place()}"


def test():
    started("pygrbl-streamer")
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
