"""The program grblhud, operated by its keyboard: grbl-hud.py PORT JOB"""

import os
import pty
import re
import subprocess
import sys
import threading
import time

from steps import MANY, contact, ensure, kept, main, stands, started, until, whole_session

PORT, JOB = sys.argv[1:]
FAR = 40
# The prompt, in which grblhud shows its number of waiting lines, the state and the position in the work's coordinates.
PROMPT = re.compile(r"(\d+)\|\S*\[(\w+) +XYZ:([-\d.]+),([-\d.]+),([-\d.]+) FS:\S*\]")

hud = None
keyboard = None
# What the program has shown, and where the newest prompt in it ends.
shown = ""


def read(screen):
    global shown
    while True:
        try:
            new = os.read(screen, 4096).decode(errors="replace")
        except OSError:
            return
        sys.stdout.write(new)
        shown += new


def connect():
    """Starts the program, which opens the port and polls for reports ten times a second."""
    global hud, keyboard, shown
    shown = ""
    keyboard, terminal = pty.openpty()
    command = [sys.executable, "-m", "grblhud", "--serial", PORT]
    # It keeps its history in the home folder.
    home = {**os.environ, "HOME": os.getcwd()}
    hud = subprocess.Popen(command, stdin=terminal, stdout=terminal, stderr=terminal, env=home, start_new_session=True)
    os.close(terminal)
    threading.Thread(target=read, args=[keyboard], daemon=True).start()
    until(lambda: state() == "Idle")
    report = answer("?", r"<Idle.*?>")
    # The program shows the last number of a position as Z.
    ensure(not re.search(r"MPos:[^,|]+,[^,|]+,[^,|]+,", report), f"Z is another axis in {report}")
    return f"{state()} at {place()}"


def close():
    enter("exit")
    until(lambda: hud.poll() is not None)
    ensure(hud.returncode == 0, f"it ends with {hud.returncode}")
    time.sleep(0.3)  # The simulated board checks from time to time whether the port is open.
    return "exit"


def prompt():
    """Returns the newest prompt, of those that come from now on."""
    begin = len(shown)
    return until(lambda: (PROMPT.findall(shown[begin:]) or [None])[-1] or hud.poll() is not None)


def state():
    return prompt()[1]


def place():
    return [float(n) for n in prompt()[2:]]


def enter(line):
    """Types a line, a key at a time."""
    for key in line + "\n":
        os.write(keyboard, key.encode())
        time.sleep(0.03)


def answer(line, text):
    """Types a line, and waits until the program shows a text that matches."""
    begin = len(shown)
    enter(line)
    return until(lambda: re.search(text, shown[begin:])).group(0)


def idle_at(x):
    until(lambda: state() == "Idle" and abs(place()[0] - x) < 0.0005)


def setting():
    return float(answer("$$", r"\$110=[\d.]+").split("=")[1])


def settings():
    return kept(setting, lambda value: enter(f"$110={value}"), close, connect)


def jog():
    for way, there in [(2, 2), (-2, 0)]:
        enter(f"$J=G91X{way}F600")
        idle_at(there)
    return "X by 2 mm and back"


def home():
    """Homes. No report is sent meanwhile, so the state may be Idle throughout: a list comes when homing is over."""
    enter("$H")
    setting()
    until(lambda: state() == "Idle")
    return f"at {place()}"


def probe():
    """Probes by the program's own command, which goes to Z-25. So the place from where it probes is made Z0."""
    enter("G0 Z-45")
    until(lambda: state() == "Idle" and place()[2] == -45)
    answer("origin Z0", "yes/no")
    enter("yes")
    until(lambda: place()[2] == 0)
    answer("Zprobe", "yes/no")
    result = contact(answer("yes", r"\[PRB:[^\]]*\]"))
    enter("G0 Z45")
    until(lambda: state() == "Idle" and place()[2] == 45)
    return result


def cancel():
    """Types `softstop` in a job. The program drops its own lines and sends M2. The board runs those that it has."""
    with open("there-and-back.nc", "w", encoding="ascii") as job:
        job.write("\n".join(["F600", *MANY]))
    answer("stream there-and-back.nc", "yes/no")
    answer("yes", "Stream send")
    until(lambda: (now := prompt())[1] == "Run" and int(now[0]) < len(MANY) - 10)
    left = int(prompt()[0])
    answer("softstop", "Issued softstop")
    until(lambda: state() == "Idle")
    ensure(left > 100 and place()[0] in (0, 1), f"{left} left, at {place()}")
    enter("G0 X0")
    idle_at(0)
    return f"{left} of {len(MANY)} lines were waiting, back at 0"


def in_move():
    enter(f"G1 X{FAR} F60")
    until(lambda: state() == "Run" and place()[0] > 1)


def reset():
    """Resets in the middle of a long move. The program asks whether that is meant."""
    in_move()
    answer("softreset", "yes/no")
    answer("yes", "ALARM:3|Grbl")
    until(lambda: state() == "Alarm")
    there = place()[0]
    enter("$X")
    until(lambda: state() == "Idle")
    ensure(1 < there < FAR and place()[0] == there, f"at {there}, then {place()}")
    enter("G0 X0")
    idle_at(0)
    return f"at X {there} of {FAR}, unlocked, back at 0"


def start():
    answer(f"stream {os.path.relpath(JOB)}", "yes/no")
    return answer("yes", r"Stream send: \d+ lines")


def hold():
    until(lambda: state() == "Run")
    time.sleep(1)
    return stands(lambda: (enter("!"), time.sleep(1)), lambda: enter("~"), state, place)


def finish():
    until(lambda: (now := prompt())[0] == "0" and now[1] == "Idle")
    ensure("error:" not in shown, re.findall("error:.*", shown)[:1])
    return f"{state()} at {place()}"


def test():
    started("grblhud")
    whole_session(
        connect=connect,
        settings=settings,
        jog=jog,
        home=home,
        probe=probe,
        cancel=cancel,
        reset=reset,
        close=close,
        start=start,
        hold=hold,
        finish=finish,
    )


main(test, stop=lambda: hud and hud.poll() is None and hud.kill())
