"""The server of OctoPrint, through its API over HTTP: octoprint-server.py PORT JOB"""

import http.client
import json
import os
import secrets
import shutil
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import printing
from steps import ensure, main, step, until

PORT, JOB = sys.argv[1:]
FAR = 40
HERE = os.path.abspath("octoprint-home")
KEY = secrets.token_hex(16)

# The configuration skips the questions to a new user, and disables functions that are not for printing.
CONFIG = f"""\
accessControl: {{autologinLocal: true}}
api: {{key: {KEY}}}
gcodeAnalysis: {{runAt: never}}
plugins: {{_disabled: [announcements, backup, discovery, errortracking, pluginmanager, softwareupdate, tracking]}}
serial: {{additionalPorts: ['{PORT}'], log: true}}
server:
  firstRun: false
  onlineCheck: {{enabled: false}}
  pluginBlacklist: {{enabled: false}}
"""

url = None
server = None


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def call(path, body=None, kind="application/json"):
    """Sends a request to the server: GET, or POST of a body. Returns None if the server says: not possible now."""
    if isinstance(body, dict):
        body = json.dumps(body).encode()
    request = urllib.request.Request(f"{url}/api/{path}", body, {"X-Api-Key": KEY, "Content-Type": kind})
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            text = answer.read()
    except urllib.error.HTTPError as error:
        if error.code == 409:
            return None
        raise
    return json.loads(text) if text else {}


def upload(name, text):
    """Puts a file into the server's folder and prints it."""
    edge = "edge-of-a-part"
    part = f'--{edge}\r\nContent-Disposition: form-data; name="{{}}"{{}}\r\n\r\n{{}}\r\n'
    body = part.format("file", f'; filename="{name}"', text) + part.format("print", "", "true") + f"--{edge}--\r\n"
    ensure(call("files/local", body.encode(), f"multipart/form-data; boundary={edge}"), f"{name} is refused")


def state():
    return call("connection")["current"]["state"]


def heard():
    """Returns the lines from the board, from the log of the server."""
    try:
        with open(os.path.join(HERE, "logs", "serial.log"), encoding="utf-8", errors="replace") as log:
            return [line.split("Recv: ", 1)[1].strip() for line in log if "Recv: " in line]
    except FileNotFoundError:
        return []


def send(*lines):
    call("printer/command", {"commands": list(lines)})


def ask(line, text):
    begin = len(heard())
    send(line)
    return until(lambda: next((said for said in heard()[begin:] if text in said), None))


def settle(name):
    printing.settle(send, ask, name)


def place():
    return printing.place(ask)


def hot_end():
    now = call("printer")
    return (now or {}).get("temperature", {}).get("tool0", {}).get("actual") or 0


def start():
    global server, url
    shutil.rmtree(HERE, ignore_errors=True)
    os.mkdir(HERE)
    with open(os.path.join(HERE, "config.yaml"), "w", encoding="ascii") as config:
        config.write(CONFIG)
    port = free_port()
    program = os.path.abspath("octoprint/bin/octoprint")
    where = ["--basedir", HERE, "--host", "127.0.0.1", "--port", str(port)]
    command = [program, "serve", "--iknowwhatimdoing", *where]
    server = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=sys.stderr)
    url = f"http://127.0.0.1:{port}"

    def version():
        try:
            return call("version")
        except (OSError, ValueError, http.client.HTTPException):
            return None

    return until(version)["text"]


def connect():
    call("connection", {"command": "connect", "port": PORT, "baudrate": 115200, "printerProfile": "_default"})
    until(lambda: state() == "Operational")
    return ask("M115", "FIRMWARE_NAME")


def temperatures():
    """Waits for a temperature. OctoPrint asks for it by itself."""
    return f"hot end {until(hot_end)}"


def heat():
    """Heats by the control for the hot end's temperature."""
    target = lambda degrees: call("printer/tool", {"command": "target", "targets": {"tool0": degrees}})
    target(60)
    until(lambda: hot_end() > 58)
    target(0)
    return f"hot end {hot_end()}"


def jog():
    head = lambda x: call("printer/printhead", {"command": "jog", "x": x, "speed": 3000})
    head(2)
    until(lambda: place()["X"] == 2)
    head(-2)
    until(lambda: place()["X"] == 0)
    return "X by 2 mm and back"


def progress():
    return call("job")["progress"]["filepos"] or 0


def pause():
    """Pauses in the middle of a print: the machine comes to rest, and then continues."""
    upload("pause.gcode", "".join(f"{line}\n" for line in printing.there_and_back(300)))
    until(lambda: progress() > 200)
    call("job", {"command": "pause", "action": "pause"})
    until(lambda: state() == "Paused")
    there, at = progress(), place()
    time.sleep(0.5)
    ensure(progress() == there and place() == at, f"it goes on, at {place()}")
    call("job", {"command": "pause", "action": "resume"})
    until(lambda: state() == "Operational")
    settle("paused and resumed")
    ensure(place()["X"] == 0, place())
    return f"stood at byte {there}, went on to the end"


def cancel():
    """Cancels a print in the middle, and goes back to where the print began."""
    upload("cancel.gcode", "".join(f"{line}\n" for line in printing.there_and_back(300)))
    until(lambda: progress() > 400)
    there = progress()
    call("job", {"command": "cancel"})
    until(lambda: state() == "Operational")
    send("G90", "G1 X0 F3000")
    settle("cancelled")
    ensure(place()["X"] == 0, place())
    return f"at byte {there}, back at 0"


def stop():
    """Sends M112. OctoPrint closes the port as well, and the machine is in an alarm: until OctoPrint connects again, which
    resets the board, or until M999 on a board with USB of its own."""
    send("M112")
    until(lambda: state().startswith(("Offline", "Closed", "Error")))
    what = state()
    connect()
    ask("M999", "ok")
    return f"{what}; connected again, M999"


def prints():
    with open(JOB, encoding="ascii") as job:
        text = job.read()
    # Allows cold extrusion, because nothing is hot.
    ask("M302 P1", "ok")
    begin = len(heard())
    upload("print.gcode", text)
    until(lambda: progress() > 10_000)
    until(lambda: state() == "Operational")
    settle("all printed")
    wrong = [line for line in heard()[begin:] if line.startswith(("Error", "Resend", "echo:Unknown"))]
    ensure(not wrong, wrong)
    return f"{len(text.splitlines())} lines, at {place()}"


def close():
    call("connection", {"command": "disconnect"})
    until(lambda: state() == "Closed")
    return "port closed"


def test():
    step("start", 60, start)
    step("connect", 30, connect)
    step("temperatures", 20, temperatures)
    step("stop", 60, stop)
    step("settings", 20, lambda: printing.settings(ask))
    step("jog", 30, jog)
    step("heat", 60, heat)
    step("pause", 90, pause)
    step("cancel", 60, cancel)
    step("print", 600, prints)
    step("close", 20, close)


def end():
    if server:
        server.kill()
        server.wait()


main(test, end)
