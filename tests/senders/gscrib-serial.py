"""The library gscrib, which writes G-code directly to a port: gscrib-serial.py PORT JOB

It opens with `G4 P0`, and waits for the `ok` of each line. It sends line numbers and checksums to a board that does not
greet with `Grbl`."""

import sys

from steps import contact, main, started, whole_session  # first: redirects what the library prints
import no_images

no_images.install()
import logging  # noqa: E402
import time  # noqa: E402

import gscrib  # noqa: E402
from gscrib.writers import printrun_writer  # noqa: E402

PORT, JOB = sys.argv[1:]

logging.basicConfig(level=logging.DEBUG, stream=sys.stderr, format="%(message)s")
builder = None


class Patient(printrun_writer.printcore):
    """Waits for the board, which DTR resets, and hears its greeting before the `ok` to the first line. Without the first
    wait that line is lost. Without the second the `ok` may come before the library's other thread has begun. The library
    then waits for ever."""

    def _listen_until_online(self):
        time.sleep(1)
        super()._listen_until_online()
        time.sleep(0.2)


printrun_writer.printcore = Patient


def connect():
    """Opens the port with the first line that is written."""
    global builder
    builder = gscrib.GCodeBuilder(direct_write="serial", port=PORT, baudrate=115200)
    builder.write("G21")
    return "G4 P0 and G21 answered"


def close():
    # At rest: a board that does not reset takes a new program for another sender only then.
    builder.write("G4 P0.1")
    builder.teardown()
    time.sleep(0.3)  # The simulated board checks from time to time whether the port is open.
    return "port closed"


def settings():
    """Stores a setting and its old value again. The library shows no settings, so their value is not read."""
    builder.write("$110=700")
    close()
    connect()
    builder.write("$110=800")
    return "written 700, and 800 after a reset"


def jog():
    builder.set_distance_mode("relative")
    builder.move(x=2, F=600)
    builder.move(x=-2)
    builder.set_distance_mode("absolute")
    return "X by 2 mm and back, by G91 and G1"


def rest():
    """Waits for the end of all motion: a pause is answered when it is over."""
    builder.sleep(0.1)


def home():
    """Homes by grbl's own line, because `auto_home` sends G28."""
    rest()
    builder.write("$H")
    return "$H answered"


def probe():
    builder.probe("towards", z=-70, F=800)
    z = builder.get_writer(0).get_parameter("Z")
    contact(f"[PRB:0,0,{z}:1]")
    builder.write("G0 Z0")
    return f"contact at {z}"


def start():
    return "line by line"


def finish():
    with open(JOB, encoding="ascii") as job:
        lines = [line.split("(")[0].split(";")[0].strip() for line in job]
    lines = [line for line in lines if line and line != "%"]
    for line in lines:
        builder.write(line)
    rest()
    return f"{len(lines)} lines answered"


def test():
    started("gscrib")
    whole_session(
        connect=connect,
        settings=settings,
        jog=jog,
        home=home,
        probe=probe,
        close=close,
        start=start,
        finish=finish,
    )


main(test)
