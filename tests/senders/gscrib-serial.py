"""The library gscrib, which writes G-code directly to a port: gscrib-serial.py PORT JOB

It opens with `G4 P0`, and waits for the `ok` of each line. It sends line numbers and checksums to a board that does not
greet with `Grbl`."""

import sys

from steps import contact, ensure, main, step, until, whole_session  # first: redirects what the library prints
import no_images

no_images.install()
import logging  # noqa: E402
import time  # noqa: E402

import gscrib  # noqa: E402

PORT, JOB = sys.argv[1:]

logging.basicConfig(level=logging.DEBUG, stream=sys.stderr, format="%(message)s")
builder = None


def connect():
    """Opens the port with the first line that is written."""
    global builder
    builder = gscrib.GCodeBuilder(direct_write="serial", port=PORT, baudrate=115200)
    builder.write("G21")
    return "G4 P0 and G21 answered"


def close():
    builder.teardown()
    time.sleep(0.3)  # The simulated board checks from time to time whether the port is open.
    return "port closed"


def place():
    return [builder.get_parameter(axis) for axis in "XYZ"]


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


def probe():
    builder.write("$H")
    builder.probe("towards", z=-70, F=800)
    until(lambda: place()[2] is not None)
    z = place()[2]
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
    builder.write("G4 P0.1")
    return f"{len(lines)} lines answered"


def test():
    step("start", 10, lambda: f"gscrib {gscrib.__version__}, Python {sys.version.split()[0]}")
    whole_session(
        connect=connect, settings=settings, jog=jog, probe=probe, close=close, start=start, finish=finish
    )


main(test)
