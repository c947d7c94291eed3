"""printcore, the library of printrun: printcore.py PORT JOB

With a further argument, the line to the simulated board damages one in a hundred of the lines with a number. Damaged lines are sent again."""

import sys
import time

from steps import ensure, main, started, step, until  # first: redirects what the library prints
import printing
from printrun.gcoder import LightGCode
from printrun.printcore import printcore

PORT, JOB, *DAMAGED = sys.argv[1:]
FAR = 40

heard = []
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
    return printing.place(ask)


def settle():
    printing.settle(host.send_now, ask)


def connect():
    host.connect(PORT, 115200)
    until(lambda: host.online)
    time.sleep(0.5)
    name = ask("M115", "FIRMWARE_NAME")
    ensure("Kerf" in name, name)
    return name


def temperatures():
    return ask("M105", "T:")


def stop():
    """Sends M112 in the middle of a long move."""
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


def heat():
    """Heats, and waits until the temperature is reached. M105 is answered meanwhile."""
    said = hear()
    host.send_now("M104 S60")
    host.send_now("M109 S60")
    host.send_now("M400")
    until(lambda: (line := ask("M105", "T:")) and degrees(line) > 58)
    host.send_now("M104 S0")
    ensure(not said("Error"), said("Error"))
    return ask("M105", "T:")


def degrees(line):
    return float(line.split("T:")[1].split()[0])


def prints():
    with open(JOB, encoding="ascii") as job:
        lines = [line.strip() for line in job]
    # Allows cold extrusion, because nothing is hot.
    ask("M302 P1", "ok")
    begin = len(heard)
    ensure(host.startprint(LightGCode(lines)), "it does not begin")
    until(lambda: not host.printing)
    settle()
    said = heard[begin:]
    resends = [line for line in said if line.startswith("Resend")]
    ensure(resends or not DAMAGED, "no line was damaged")
    errors = [line for line in said if line.startswith("Error") and "Last Line" not in line]
    ensure(not errors, errors)
    return f"{len(lines)} lines, {len(resends)} asked for again, at {place()}"


def pause():
    """Pauses in the middle of a print: the machine comes to rest, and then continues."""
    host.startprint(LightGCode(printing.there_and_back(300)))
    until(lambda: host.queueindex > 10)
    host.pause()
    ensure(host.paused, "it is not paused")
    settle()
    there, at = host.queueindex, place()
    time.sleep(0.5)
    ensure(host.queueindex == there and place() == at, f"it goes on, at {place()}")
    host.resume()
    until(lambda: not host.printing)
    settle()
    return f"stood at line {there}, went on, at {place()}"


def cancel():
    """Cancels a print in the middle, and goes back to where the print began."""
    host.startprint(LightGCode(printing.there_and_back(300)))
    until(lambda: host.queueindex > 20)
    host.cancelprint()
    until(lambda: not host.printing)
    there = host.queueindex
    for line in ["G90", "G1 X0 F3000"]:
        host.send_now(line)
    settle()
    ensure(place()["X"] == 0, place())
    return f"at line {there}, back at 0"


def close():
    host.disconnect()
    return "port closed"


def test():
    started("printrun")
    step("connect", 30, connect)
    step("temperatures", 20, temperatures)
    step("settings", 20, lambda: printing.settings(ask))
    step("heat", 60, heat)
    step("stop", 60, stop)
    step("pause", 60, pause)
    step("cancel", 60, cancel)
    step("print", 600, prints)
    step("close", 20, close)


main(test)
