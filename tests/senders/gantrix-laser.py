"""The framework gantrix with its laser: gantrix-laser.py PORT JOB

It sends a line, and waits for its `ok`, before it sends the next. Its own jobs begin with `$H`."""

import sys
import threading
import time

from steps import ensure, main, started, until, whole_session  # first: redirects what the library prints
from gantrix.design.text import layout_text
from gantrix.job import Job
from gantrix.tools.laser import LaserTool
from gantrix.transport import GrblError, GrblTransport

PORT, JOB = sys.argv[1:]

gantry = GrblTransport(PORT)
done = 0
whole = 0


def connect():
    """Opens the port and lets the framework send its own first lines: two empty ones, M5, $X."""
    gantry.connect()
    return "M5 and $X answered"


def close():
    gantry.disconnect()
    time.sleep(0.3)  # The simulated board checks from time to time whether the port is open.
    return "M5 answered, port closed"


def home():
    gantry.home()
    return "$H answered"


def rest():
    """Waits for the end of all motion: a pause is answered when it is over."""
    gantry.send("G4 P0.1", timeout=60)


def engrave(**more):
    """Engraves a text as `gantrix text` does. Returns how many of its lines are done."""
    global done
    done = 0

    def count(line, _):
        global done
        done = line

    placed, _ = layout_text("A")
    laser = LaserTool(power=600, speed=3000)
    Job(gantry, laser, placed, height=10, line_gap=1, on_progress=count, **more).run()
    return done


def design():
    """Engraves a text. A job ends with the `ok` of its last move, and the next one begins with `$H`, which is refused in
    motion, so the driver waits for rest."""
    global whole
    whole = engrave()
    rest()
    return f"{whole} lines of a text"


def cancel():
    some = engrave(should_cancel=lambda: done > 3)
    rest()
    ensure(0 < some < whole, f"cancelled at {some} of {whole}")
    return f"at {some} of {whole} lines"


def reset():
    """Calls the emergency stop while another thread waits for the end of a move. Then unlocks: a new connection begins
    with M5, which is refused in an alarm if DTR has not reset the board. Goes back to 0, from where the job is counted on
    such a board."""
    told = []

    def wait():
        try:
            for line in ["G91", "G1 X20 F60", "G4 P0"]:
                gantry.send(line)
        except GrblError as error:
            told.append(str(error))

    waiting = threading.Thread(target=wait, daemon=True)
    waiting.start()
    time.sleep(2)
    gantry.emergency_stop()
    until(lambda: told)
    ensure("reset" in told[0], told[0])
    for line in ["$X", "G90", "G0 X0 Y0"]:
        gantry.send(line)
    rest()
    return f"it is told: {told[0]}; unlocked"


def start():
    return "line by line"


def finish():
    with open(JOB, encoding="ascii") as job:
        lines = [line.split("(")[0].split(";")[0].strip() for line in job]
    lines = [line for line in lines if line and line != "%"]
    for line in lines:
        gantry.send(line, timeout=60)
    rest()
    return f"{len(lines)} lines answered"


def test():
    started("gantrix")
    whole_session(
        connect=connect,
        home=home,
        design=design,
        cancel=cancel,
        reset=reset,
        close=close,
        start=start,
        finish=finish,
    )


main(test)
