"""The habit of grbl's own scripts for streaming: stream-py.py PORT JOB

It wakes the board with empty lines, waits two seconds, drops what it has received, and then sends each line of the
file, also those that are empty without their comment. Each needs its own `ok`. It counts up to 128 characters."""

import re
import sys
import time

from steps import ensure, main, started, whole_session
import serial

PORT, JOB = sys.argv[1:]
BUFFER = 128

port = None
lengths = []
lines = []


def connect():
    global port
    port = serial.Serial(PORT, 115200, timeout=20)
    port.write(b"\r\n\r\n")
    time.sleep(2)
    port.reset_input_buffer()
    return "woken"


def close():
    port.close()
    time.sleep(0.3)  # The simulated board checks from time to time whether the port is open.
    return "port closed"


def answer():
    """Waits for the answer to the oldest line."""
    line = port.readline().decode().strip()
    ensure(line == "ok" or line and not line.startswith("error"), f"{lines[:1]} is answered by {line!r}")
    if line == "ok":
        lengths.pop(0)


def start():
    with open(JOB, encoding="ascii") as file:
        lines.extend(re.sub(r"\s|\(.*?\)|;.*", "", line).upper() for line in file)
    return f"{len(lines)} lines, {lines.count('')} of them empty, counting characters"


def finish():
    """Sends the whole job. The script ends with the last `ok`, so the driver waits until the machine is at rest."""
    for line in lines:
        lengths.append(len(line) + 1)
        while sum(lengths) >= BUFFER:
            answer()
        port.write(line.encode() + b"\n")
    while lengths:
        answer()
    port.write(b"G4 P0.1\n")
    lengths.append(8)
    while lengths:
        answer()
    return f"{len(lines)} lines answered"


def test():
    started("pyserial")
    whole_session(connect=connect, close=close, start=start, finish=finish)


main(test)
