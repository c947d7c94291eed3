"""The library grbl-streamer: grbl-streamer.py PORT JOB"""

import sys
import time

from steps import contact, ensure, main, session, started, until  # first: redirects what the library prints
import grbl_streamer

PORT, JOB = sys.argv[1:]
FAR = 40

heard = []
errors = []
alarms = []
done = 0
wanted = False


def tell(event, *data):
    """Takes an event of the library. Lines of the board other than `ok` come as `on_read`."""
    global done, wanted
    if event == "on_read":
        heard.append(data[0])
    elif event == "on_rx_buffer_percent" and wanted:
        grbl.job_run()
        wanted = False
    elif event == "on_error":
        errors.append(data[:2])
    elif event == "on_alarm":
        alarms.append(data[0])
    elif event == "on_processed_command":
        done += 1
    print(event, *data)


class Slow(grbl_streamer.Interface):
    """Opens the port and waits for the board, which DTR resets. A real board loses what comes before it listens."""

    def start(self, queue):
        super().start(queue)
        time.sleep(1)


grbl_streamer.Interface = Slow
grbl = grbl_streamer.GrblStreamer(tell)


def state():
    return (grbl.cmode or "").split(":")[0]


def x():
    return grbl.cmpos[0]


def idle_at(place):
    until(lambda: state() == "Idle" and abs(x() - place) < 0.0005)


def hear():
    begin = len(heard)
    return lambda text, end="": next(
        (line for line in heard[begin:] if line.startswith(text) and line.endswith(end)), None
    )


def connect():
    """Opens the port, which resets the board, as DTR does. Then sends a reset and waits for the greeting."""
    grbl.cnect(PORT, 115200)
    until(grbl.is_connected)
    grbl.poll_start()
    until(lambda: state() == "Idle")
    quiet()
    return f"greeted, {state()}"


def quiet():
    """Waits until the library's own questions have been answered. It asks them at each start and at each rest."""
    until(lambda: not (grbl.hash_state_requested or grbl.gcode_parser_state_requested))
    said = hear()
    grbl.get_gcode_parser_state()
    until(lambda: said("[GC:"))
    time.sleep(0.5)


def close():
    grbl.disconnect()
    ensure(not grbl.is_connected(), "it is open")
    time.sleep(0.3)  # The simulated board checks from time to time whether the port is open.
    return "port closed"


def setting():
    said = hear()
    grbl.request_settings()
    return float(until(lambda: said("$110=")).split("=")[1])


def run():
    """Runs the job on the thread on which the library hears the board.

    At each `ok` the library fills the board's buffer on that thread, without a lock. If a
    second thread fills the buffer at the same time, a line may be lost. The `ok` to a
    question makes that thread call `job_run`.
    """
    global wanted
    wanted = True
    grbl.get_gcode_parser_state()
    until(lambda: not wanted)


def send(lines):
    """Sends lines one by one, and waits until all are answered."""
    grbl.incremental_streaming = True
    grbl.job_new()
    grbl.write(lines)
    grbl.job_run()
    until(lambda: grbl.job_finished or errors)
    ensure(not errors, f"it is told {errors[:1]}")
    grbl.incremental_streaming = False


def settings():
    before = setting()
    # The library asks by itself as well, so the next answer may belong to an earlier question.
    send(["$110=700"])
    until(lambda: setting() == 700)
    close()
    connect()
    ensure(setting() == 700, "the new value is not kept")
    send([f"$110={before:.3f}"])
    until(lambda: setting() == before)
    return f"{before}, written 700, kept over a reset, written back"


def jog():
    grbl.send_immediately("$J=G91X2F600")
    idle_at(2)
    grbl.send_immediately("$J=G91X-2F600")
    idle_at(0)
    return "X by 2 mm and back"


def overrides():
    """Changes the feed. The library does not use grbl's overrides; it changes F in the lines that it sends."""
    grbl.set_feed_override(True)
    grbl.request_feed(480)
    said = hear()
    send(["G1 X1 F60"])
    idle_at(1)
    grbl.get_gcode_parser_state()
    modes = until(lambda: said("[GC:"))
    grbl.set_feed_override(False)
    send(["G1 X0"])
    idle_at(0)
    ensure(" F480" in modes, modes)
    return "F60 is sent as F480"


def home():
    for axis in "XYZ":
        send([f"$H{axis}"])
    until(lambda: state() == "Idle" and grbl.cmpos == (0, 0, 0))
    return f"at {grbl.cmpos}"


def probe():
    said = hear()
    send(["G38.2 Z-70 F800"])
    # The library's own `$#` also lists the last contact, so a line without contact may come first.
    return contact(until(lambda: said("[PRB:", ":1]")))


def stop():
    """Sends a reset in the middle of a long move."""
    send(["G90", "G0 Z0"])
    until(lambda: state() == "Idle")
    grbl.job_new()
    grbl.write([f"G1 X{FAR} F60", "G1 X0"])
    run()
    until(lambda: state() == "Run" and x() > 1)
    said = hear()
    grbl.abort()
    until(lambda: said("Grbl 1.1") and state() == "Alarm")
    ensure(alarms == ["ALARM:3"], f"alarms {alarms}")
    time.sleep(1)
    there = x()
    grbl.killalarm()
    until(lambda: state() == "Idle")
    ensure(1 < there < FAR and x() == there, f"at {there}, then {x()}")
    send(["G0 X0"])
    idle_at(0)
    return f"ALARM:3, at X {there} of {FAR}, unlocked, back at 0"


def start():
    global done
    del errors[:]
    done = 0
    grbl.job_new()
    grbl.load_file(JOB)
    quiet()
    run()
    return f"{grbl.buffer_size} lines, counting characters"


def hold():
    until(lambda: errors or done > grbl.buffer_size / 10 and state() == "Run")
    ensure(not errors, f"it is told {errors[:1]}")
    grbl.hold()
    until(lambda: grbl.cmode == "Hold:0")
    there = grbl.cmpos
    time.sleep(1)
    ensure(grbl.cmpos == there and grbl.cmode == "Hold:0", "it moves in hold")
    grbl.resume()
    until(lambda: state() == "Run")
    return "stands in Hold:0, goes on"


def finish():
    until(lambda: errors or grbl.job_finished)
    ensure(not errors, f"it is told {errors[:1]}")
    until(lambda: state() == "Idle")
    return f"{done} of {grbl.buffer_size} lines answered, {state()} at {grbl.cmpos}"


def test():
    started("grbl-streamer")
    session(
        connect=connect,
        settings=settings,
        jog=jog,
        overrides=overrides,
        home=home,
        probe=probe,
        stop=stop,
        close=close,
        start=start,
        hold=hold,
        finish=finish,
    )


main(test)
