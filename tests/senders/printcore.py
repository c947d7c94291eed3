"""printcore of printrun, the library: printcore.py PORT JOB

One line in a hundred is damaged on its way, and sent again. The job is written for the checker, to whom the extruder is A: here it is E."""

import importlib.metadata
import random
import sys
import time

from steps import ensure, main, step, until  # first: what the library prints is no step
from printrun.gcoder import LightGCode
from printrun.printcore import printcore

PORT, JOB = sys.argv[1:]
FAR = 40

heard = []
damaged = 0
random.seed(21)
host = printcore()
host.recvcb = lambda line: heard.append(line.strip())


def hear():
    begin = len(heard)
    return lambda text: next((line for line in heard[begin:] if text in line), None)


def ask(line, text):
    said = hear()
    host.send_now(line)
    return until(lambda: said(text))


def place():
    words = ask("M114", "Count").split()
    return {word[0]: float(word[2:]) for word in words[:4]}


def connect():
    host.connect(PORT, 115200)
    until(lambda: host.online)
    time.sleep(0.5)
    name = ask("M115", "FIRMWARE_NAME")
    ensure("Kerf" in name, name)
    return name


def temperatures():
    return ask("M105", "T:")


def damage():
    """Every line that has a number may lose a byte of it, or have another one instead."""
    send = host._send

    def write(text, *rest, **words):
        global damaged
        return send(text, *rest, **words)

    host._send = write
    port = host.printer
    put = port.write

    def put_damaged(data):
        global damaged
        if data.startswith(b"N") and b"M110" not in data and random.random() < 0.01:
            damaged += 1
            at = random.randrange(len(data) - 1)
            data = data[:at] + bytes([data[at] ^ 0x02]) + data[at + 1 :]
        return put(data)

    port.write = put_damaged


def stop():
    """M112 in the middle of a long move."""
    host.send_now("G90")
    host.send_now(f"G1 X{FAR} F60")
    until(lambda: place()["X"] > 1)
    ask("M112", "Error:")
    time.sleep(0.5)
    there = place()["X"]
    time.sleep(0.5)
    ensure(1 < there < FAR and place()["X"] == there, f"at {there}")
    host.send_now("M999")
    host.send_now("G1 X0 F3000")
    until(lambda: place()["X"] == 0)
    return f"at X {there} of {FAR}, M999, back at 0"


def prints():
    with open(JOB, encoding="ascii") as job:
        lines = [line.strip().replace(" A", " E") for line in job]
    damage()
    resends = hear()
    ensure(host.startprint(LightGCode(lines)), "it does not begin")
    until(lambda: not host.printing)
    ask("M400", "ok")
    end = place()
    ensure(damaged > 0 and resends("Resend"), "no line was damaged")
    said = [line for line in heard if line.startswith("Error") and "Last Line" not in line]
    ensure(len(said) <= 2, said)
    return f"{len(lines)} lines, {damaged} damaged and sent again, at {end}"


def pause():
    """Pauses in the middle of a print of its own, which goes on."""
    lines = ["G91"] + ["G1 X0.5 F1200", "G1 X-0.5"] * 500 + ["G90"]
    host.startprint(LightGCode(lines))
    until(lambda: host.queueindex > 10)
    host.pause()
    ensure(host.paused, "it is not paused")
    host.resume()
    until(lambda: not host.printing)
    ask("M400", "ok")
    return f"goes on, at {place()}"


def close():
    host.disconnect()
    return "port closed"


def test():
    version = importlib.metadata.version("printrun")
    step("start", 10, lambda: f"printrun {version}, Python {sys.version.split()[0]}")
    step("connect", 30, connect)
    step("temperatures", 20, temperatures)
    step("stop", 60, stop)
    step("pause", 60, pause)
    step("print", 300, prints)
    step("close", 20, close)


main(test)
