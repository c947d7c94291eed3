"""MeerK40t's console with its driver for grbl: meerk40t-console.py PORT JOB"""

import os
import re
import subprocess
import sys
import threading
import time

from steps import ensure, kept, main, stands, started, until, whole_session

PORT, JOB = sys.argv[1:]
FAR = 40

console = None
# The lines that the console has shown. Those of the board come by the channels that `connect` prints.
heard = []


def read(output):
    for line in output:
        print(line, end="")
        heard.append(re.sub(r"^>+", "", line).strip())


def enter(*lines):
    for line in lines:
        console.stdin.write(line + "\n")
        console.stdin.flush()


def hear():
    begin = len(heard)
    return lambda text: next((line for line in heard[begin:] if re.match(text, line)), None)


def answer(line, text):
    said = hear()
    enter(line)
    return until(lambda: said(text))


def connect():
    """Starts the program without its windows, and adds a device as its users do. The first line opens the port; then
    the program sends `$`, `$$`, `$G` and `?`, and waits for the answers before it sends anything else."""
    global console
    command = [os.path.join(os.path.dirname(sys.executable), "meerk40t"), "-z", "-c", "-A", "-X"]
    # It keeps its settings in the home folder.
    home = {**os.environ, "HOME": os.getcwd()}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    console = subprocess.Popen(command, text=True, env=home, **pipes)
    threading.Thread(target=read, args=[console.stdout], daemon=True).start()
    enter("device add grbl-generic", f"set -p grbl serial_port {PORT}", "set -p grbl has_endstops True")
    enter(*(f"channel print {name}-Grbl" for name in ["send", "recv", "events"]))
    said = hear()
    version = answer("grbl $I", r"\[VER:")
    ensure(said("Connection Confirmed"), "it has not confirmed the connection")
    return version


def close():
    enter("quit")
    until(lambda: console.poll() is not None)
    time.sleep(0.3)  # The simulated board checks from time to time whether the port is open.
    return "quit"


def report():
    """Asks for a report. Returns the state and the position of X."""
    state, place = re.match(r"<([^|]*)\|MPos:([^,]*)", answer("grbl_realtime ?", r"<.*>$")).groups()
    return state, float(place)


def idle_at(x):
    until(lambda: (now := report())[0] == "Idle" and abs(now[1] - x) < 0.0005)


def setting():
    said = hear()
    answer("grbl $$", r"ok / \d+ -- \$\$")
    return float(said(r"\$110=").split("=")[1])


def settings():
    return kept(setting, lambda value: answer(f"grbl $110={value}", r"ok / \d+ -- \$110"), close, connect)


def jog():
    """Moves by the console's own command, which sends `G91` and `G0`."""
    for way, there in [(2, 2), (-2, 0)]:
        enter(f"move_relative {way}mm 0mm")
        idle_at(there)
    return "X by 2 mm and back"


def home():
    """Homes by `$H`, which the console calls physical, and then by G28, which goes to machine zero."""
    answer("physical_home", r"ok / \d+ -- \$H")
    there = report()
    answer("home", r"ok / \d+ -- G28")
    idle_at(0)
    return f"{there}; G28 answered"


PLAN = ["plan copy preprocess validate blob preopt optimize", "plan spool"]


def design():
    """Burns a square and a circle that the console draws. Each is a layer with a speed of its own, in mm/s."""
    said = hear()
    enter("rect 10mm 210mm 10mm 8mm engrave -s 12.5", "circle 30mm 214mm 4mm engrave -s 10", *PLAN)
    until(lambda: said(r"M5$") and said(r"ok / 0 -- M5"))
    until(lambda: report()[0] == "Idle")
    ensure(not said("ERROR"), said("ERROR"))
    enter("operation* delete", "element* delete")
    answer("grbl G0 X0 Y0", r"ok / \d+ -- G0 X0 Y0")
    idle_at(0)
    return "a square and a circle by M4, G0 and G1 with S"


def stop(command):
    """Stops a long move, and unlocks."""
    enter("grbl G90", f"grbl G1 X{FAR} F60")
    until(lambda: (now := report())[0] == "Run" and now[1] > 1)
    said = hear()
    enter(command)
    until(lambda: said("Connection Confirmed"))
    ensure(said("ALARM:3") and report()[0] == "Alarm", f"{report()}")
    there = report()[1]
    answer("clear_alarm", r"ok / \d+ -- \$X")
    ensure(report() == ("Idle", there) and 1 < there < FAR, f"at {there}, then {report()}")
    enter("grbl G0 X0")
    idle_at(0)
    return f"{command}: ALARM:3, at X {there} of {FAR}, unlocked, back at 0"


said = None


def start():
    """Loads the job and spools it. A file without CR counts as one line, which never fits, so lines end with CR LF."""
    global said
    with open(JOB, encoding="ascii") as job, open("job.nc", "w", encoding="ascii", newline="\r\n") as copy:
        copy.write(job.read())
    said = hear()
    enter(f"load {os.path.abspath('job.nc')}", *PLAN)
    until(lambda: said(".*Spooled Plan"))
    return "counting characters"


def hold():
    with open(JOB, "rb") as file:
        lines = len(file.readlines())
    begin = len(heard)
    until(lambda: heard[begin:].count("ok") > lines / 10 and report()[0] == "Run")
    return stands(lambda: enter("pause"), lambda: enter("resume"), lambda: report()[0], lambda: report()[1])


def finish():
    until(lambda: said(r"ok / \d+ -- .*M(2|30)$"))
    until(lambda: report()[0] == "Idle")
    ensure(not said("ERROR"), said("ERROR"))
    return f"{report()}"


def test():
    started("meerk40t")
    whole_session(
        connect=connect,
        settings=settings,
        jog=jog,
        home=home,
        design=design,
        cancel=lambda: stop("estop"),
        reset=lambda: stop("soft_reset"),
        close=close,
        start=start,
        hold=hold,
        finish=finish,
    )


main(test, stop=lambda: console and console.poll() is None and console.kill())
