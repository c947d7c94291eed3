"""pronsole, the console of printrun: pronsole-card.py PORT JOB

It uploads the job to the SD card, lists the card, and prints the file from there."""

import os
import sys
import tempfile

from steps import ensure, main, started, step, until  # first: redirects what the library prints
import no_window
import printing

no_window.install(no_window.WX)
from printrun.pronsole import pronsole

PORT, JOB = sys.argv[1:]
NAME = "job.g"

# pronsole keeps its settings at home.
os.environ["HOME"] = tempfile.mkdtemp()
heard = []
console = pronsole()
console.recvlisteners.append(lambda line: heard.append(line.strip()))


def ask(line, text):
    begin = len(heard)
    console.onecmd(line)
    return until(lambda: next((line for line in heard[begin:] if text in line), None))


def connect():
    console.onecmd(f"connect {PORT} 115200")
    until(lambda: console.p.online)
    return ask("M115", "FIRMWARE_NAME")


def mount():
    ask("M302 P1", "ok")
    return ask("M21", "SD card ok")


def upload():
    """Writes the job to the card. Nothing moves meanwhile."""
    before = printing.place(ask)
    ask(f"upload {JOB} {NAME}", "Done saving file")
    until(lambda: NAME in console.sdfiles)
    ensure(printing.place(ask) == before, "it has moved")
    return f"{os.path.getsize(JOB)} bytes"


def prints():
    """Prints the file, and asks for the progress meanwhile."""
    begin = len(heard)
    console.onecmd(f"sdprint {NAME}")
    until(lambda: any("File selected" in line for line in heard[begin:]))
    progress = ask("M27", "SD printing byte")
    until(lambda: any("Done printing file" in line for line in heard[begin:]))
    errors = [line for line in heard[begin:] if line.startswith("Error")]
    ensure(not errors, errors)
    return f"{progress}, at {printing.place(ask)}"


def deletes():
    ask(f"M30 {NAME}", "File deleted")
    return ask("M20", "End file list")


def close():
    console.onecmd("disconnect")
    return "port closed"


def test():
    started("printrun")
    step("connect", 30, connect)
    step("mount", 20, mount)
    step("upload", 120, upload)
    step("print", 600, prints)
    step("delete", 20, deletes)
    step("close", 20, close)


main(test)
