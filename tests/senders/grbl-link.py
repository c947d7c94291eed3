"""The library grbl-link: grbl-link.py PORT JOB

It runs with its default protocol, one line after the other, because its other one, which counts characters, drops the
lines that do not fit."""

import sys
import time

from steps import ensure, kept, main, stands, started, until, whole_session  # first: redirects what the library prints
import serial
from grbl_link.interface import Grbl
from grbl_link.messages import AlarmMessage, ErrorMessage, OKMessage, StatusMessage, WelcomeMessage

PORT, JOB = sys.argv[1:]
FAR = 40

port = None
grbl = None
heard = []


def connect():
    """Opens the port, which resets the board. The library waits for nothing, so the driver waits for the greeting."""
    global port, grbl
    port = serial.Serial(PORT, 115200)
    grbl = Grbl(port)
    grbl.add_message_handler(lambda message, _: (heard.append(message), print("<", message)))
    until(lambda: grbl.version)
    return f"version {grbl.version}, {state()}"


def close():
    grbl.stop()
    port.close()
    time.sleep(0.3)  # The simulated board checks from time to time whether the port is open.
    return "port closed"


def hear(kind):
    begin = len(heard)
    return lambda: next((message for message in heard[begin:] if isinstance(message, kind)), None)


def state():
    """Asks for a report. The library knows the real-time bytes only as bytes; its own `query_status` sends a line."""
    report = hear(StatusMessage)
    grbl.send(b"?")
    until(report)
    return grbl.status["mode"]


def x():
    return grbl.status["MPos"][0]


def idle_at(place):
    until(lambda: state() == "Idle" and abs(x() - place) < 0.0005)


def send(*lines):
    """Sends lines and waits until all have been answered."""
    begin = len(heard)
    for line in lines:
        grbl.send(line)
    answers = lambda: [message for message in heard[begin:] if isinstance(message, (OKMessage, ErrorMessage))]
    until(lambda: len(answers()) >= len(lines))
    refused = [message for message in answers() if isinstance(message, ErrorMessage)]
    ensure(not refused, refused)


def setting():
    grbl.state.settings.clear()
    grbl.query_settings()
    # The setting that is listed last comes after that of the velocity.
    return float(until(lambda: "132" in grbl.state.settings and grbl.state.settings["110"]))


def settings():
    return kept(setting, lambda value: send(f"$110={value}"), close, connect)


def jog():
    grbl.jog(600, x=2)
    idle_at(2)
    grbl.jog(60, x=FAR)
    until(lambda: state() == "Jog" and x() > 3)
    grbl.jog_cancel()
    until(lambda: state() == "Idle")
    there = x()
    ensure(there < FAR, f"at {there}")
    grbl.jog(600, relative=False, x=0)
    idle_at(0)
    return f"X by 2 mm, cancelled at {there}, back at 0"


def home():
    send("$H")
    return f"{state()} at {grbl.status['MPos']}"


def reset():
    """Resets in the middle of a long move."""
    send("G90")
    alarm, greeting = hear(AlarmMessage), hear(WelcomeMessage)
    grbl.send(f"G1 X{FAR} F60")
    until(lambda: state() == "Run" and x() > 1)
    grbl.soft_reset()
    until(lambda: alarm() and greeting())
    send("$X")
    until(lambda: state() == "Idle")
    there = x()
    ensure(1 < there < FAR, f"at {there}")
    send("G0 X0")
    idle_at(0)
    return f"ALARM:{alarm().alarm_state}, at X {there} of {FAR}, unlocked, back at 0"


sent = []
before = 0


def start():
    global before
    with open(JOB, encoding="ascii") as job:
        sent.extend(line.strip() for line in job if line.strip())
    before = len(heard)
    for line in sent:
        grbl.send(line)
    return f"{len(sent)} lines, each after the `ok` of the one before"


def answered():
    refused = [message for message in heard[before:] if isinstance(message, ErrorMessage)]
    ensure(not refused, f"{refused[:1]} is told")
    return sum(isinstance(message, OKMessage) for message in heard[before:])


def hold():
    until(lambda: answered() > len(sent) / 10 and state() == "Run")
    return stands(lambda: grbl.send(b"!"), lambda: grbl.send(b"~"), state, lambda: grbl.status["MPos"])


def finish():
    until(lambda: answered() >= len(sent))
    until(lambda: state() == "Idle")
    return f"{answered()} lines answered, Idle at {grbl.status['MPos']}"


def test():
    started("grbl-link")
    whole_session(
        connect=connect,
        settings=settings,
        jog=jog,
        home=home,
        reset=reset,
        close=close,
        start=start,
        hold=hold,
        finish=finish,
    )


main(test)
