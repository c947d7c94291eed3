"""marlin-host, a client for Marlin: marlin-host.py PORT JOB

It has one line in flight and gives up at each `Error:`. So lines of slicers that the board does not support must not be
answered with an error."""

import sys
import threading
import time

from steps import ensure, main, started, step, until  # first: redirects what the library prints
import printing
from marlin_host import MarlinHost, SerialTransport

PORT, JOB = sys.argv[1:]
# More moves there and back than any board has room for.
PAIRS = 600
FAR = 40

# Lines that slicers send besides moves, and that this board does not support.
PASSED_OVER = """\
M862.3 P "MK3S"
M73 P0 R54
M204 P1250 R1250 T1250
M205 X8.00 Y8.00 Z0.40 E4.50
M900 K30
G80
M106 P2 S255
M107 P1
M104 S0 T1
T1
M104
M486 S-1
M117 Layer 1 of 50
M84 S30
"""

host = None


def ask(line, text):
    """Sends a line. Returns the line before `ok` that contains the text."""
    lines = [told.raw for told in host.query(line)]
    return next((told for told in lines if text in told), "ok" if text == "ok" else None)


def open_port():
    global host
    host = MarlinHost(SerialTransport(PORT, 115200, reset_on_open=False), reliable=True)
    host.connect()


def connect():
    open_port()
    missing = [name for name in ("EMERGENCY_PARSER", "AUTOREPORT_TEMP") if not host.profile.has(name)]
    ensure(not missing, missing)
    return host.profile.firmware


def temperatures():
    now = host.temperatures()
    ensure(now["T"] > 0 and now["B"] > 0, now)
    return now


def place():
    return host.position()


def stop():
    """Sends M112 in the middle of a long move, and connects again, as the library requires."""
    host.send(f"G1 X{FAR} F60")
    until(lambda: place()["X"] > 1)
    host.emergency_stop()
    time.sleep(0.5)
    host.close()
    open_port()
    host.send("M999")
    there = place()["X"]
    ensure(0 <= there < FAR and place()["X"] == there, f"at {there}")
    host.send("G1 X0 F3000")
    return f"at X {there} of {FAR}, connected again, M999"


def passed_over():
    lines = PASSED_OVER.splitlines()
    for line in lines:
        host.send(line)
    return f"{len(lines)} lines"


def heat():
    """Heats. `ok` comes when the temperature is reached."""
    host.send("M109 S60")
    hot = host.temperatures()["T"]
    ensure(hot > 58, f"answered at {hot}")
    host.send("M104 S0")
    return f"hot end {hot}"


def pause():
    """Pauses in the middle of a print: the machine comes to rest, and then continues."""
    done = []
    print_it = lambda: done.extend(host.stream(printing.there_and_back(PAIRS, way=0.05)))
    thread = threading.Thread(target=print_it, daemon=True)
    thread.start()
    time.sleep(0.3)
    host.pause()
    host.send("M400")
    at = place()
    ensure(thread.is_alive() and place() == at, f"it goes on, at {place()}")
    host.resume()
    until(lambda: not thread.is_alive())
    ensure(len(done) == 2 * PAIRS + 2, f"{len(done)} lines")
    host.send("M400")
    return f"stood at {at}, went on, at {place()}"


def prints():
    with open(JOB, encoding="ascii") as job:
        done = list(host.stream(job))
    host.send("M400")
    return f"{len(done)} lines, at {place()}"


def close():
    host.close()
    return "port closed"


def test():
    started("marlin-host")
    step("connect", 30, connect)
    step("temperatures", 20, temperatures)
    step("settings", 20, lambda: printing.settings(ask))
    step("stop", 60, stop)
    step("passed over", 20, passed_over)
    # Allows cold extrusion, because nothing is hot.
    step("cold", 20, lambda: ask("M302 P1", "ok"))
    step("heat", 60, heat)
    step("pause", 60, pause)
    step("print", 600, prints)
    step("close", 20, close)


main(test)
