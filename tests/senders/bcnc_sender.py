"""bCNC without its window: its `Sender`, which has the serial line, the controllers and the stream, with the few
things that the window does for it."""

import builtins
import contextlib
import importlib.util
import os
import sys
import threading
import time

import no_window

VERSION = "0.9.16"


def _find():
    """Makes bCNC's modules importable, which import each other by bare names."""
    no_window.install()
    builtins._ = lambda text: text
    folder = os.path.dirname(importlib.util.find_spec("bCNC").origin)
    sys.path[:0] = [folder] + [os.path.join(folder, name) for name in ("lib", "controllers")]


_find()

# pylint: disable=wrong-import-position
import Sender  # noqa: E402
import Utils  # noqa: E402
from CNC import CNC, WAIT  # noqa: E402


class Bcnc(Sender.Sender):
    """A bCNC that a program works with instead of a person."""

    def __init__(self, port, controller):
        Utils.loadConfiguration(True)
        super().__init__()
        self.port = port
        self.controllerSet(controller)
        # Lines of the board that it has passed to its terminal, and those of them that it shows in red.
        self.heard = []
        self.errors = []
        self.refused = None
        monitor = threading.Thread(target=self._monitor, daemon=True)
        monitor.start()

    # What the window does when the sender has news of the state of its buttons; here it has none.
    def enable(self):
        pass

    disable = busy = notBusy = enable

    def event_generate(self, *_, **__):
        pass

    def openClose(self, _=None):
        """The button "Open", which is "Close" while the port is open."""
        if self.serial is None:
            self.open(self.port, 115200)
        else:
            self.close()

    def _monitor(self):
        """What the window looks at several times a second."""
        while True:
            with contextlib.suppress(Sender.Empty):
                while True:
                    kind, text = self.log.get_nowait()
                    self._tell(kind, str(text).strip())
            self._pause = "Hold" in CNC.vars["state"]
            if self.running and self._gcount >= self._runLines:
                self.runEnded()
            time.sleep(0.05)

    def _tell(self, kind, text):
        if kind in (Sender.Sender.MSG_RECEIVE, Sender.Sender.MSG_OK, Sender.Sender.MSG_ERROR):
            self.heard.append(text)
        if kind == Sender.Sender.MSG_ERROR:
            self.errors.append(text)
        print(kind, text)

    def _settle(self):
        """Waits until what it asks by itself has been answered. It asks when the machine comes to rest, and counts the
        answers to the lines of the job if the job has begun meanwhile: it then takes the job for ended too early."""
        count = None
        while not self.queue.empty() or count != len(self.heard):
            count = len(self.heard)
            time.sleep(1)

    def start(self, lines=None):
        """The button "Start": sends the file that is loaded, or these lines."""
        assert self.serial and not self.running
        self._settle()
        self.cleanAfter = True
        # So many tell its thread that there are lines still to come.
        self._runLines = sys.maxsize
        self._gcount = 0
        self.initRun()
        CNC.vars["running"] = CNC.vars["_OvChanged"] = True
        if lines is None:
            count = len(self.gcode.compile(self.queue))
        else:
            lines = [line for line in CNC.compile(lines) if line is not None]
            count = len(lines)
            for line in lines:
                self.queue.put(line + "\n")
        self._runLines = count + 1
        self.queue.put((WAIT,))
        return count

    @staticmethod
    def get(name):
        """One of its variables."""
        return CNC.vars[name]

    @staticmethod
    def put(name, value):
        CNC.vars[name] = value
