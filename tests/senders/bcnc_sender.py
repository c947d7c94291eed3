"""bCNC without its window. Its class `Sender` has the serial line, the controllers and the stream. This module replaces
the few functions of the window that `Sender` uses."""

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
    """Makes bCNC's modules importable. They import each other by bare names."""
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
    """A bCNC that a program operates instead of a person."""

    def __init__(self, port, controller):
        Utils.loadConfiguration(True)
        super().__init__()
        self.port = port
        self.controllerSet(controller)
        # Lines of the board that bCNC has shown in its terminal, and those of them that it shows in red.
        self.heard = []
        self.errors = []
        self.refused = None
        monitor = threading.Thread(target=self._monitor, daemon=True)
        monitor.start()

    # The window's functions for changes of its buttons. They do nothing, because there is no window.
    def enable(self):
        pass

    disable = busy = notBusy = enable

    def event_generate(self, *_, **__):
        pass

    def openClose(self, _=None):
        """Presses the button "Open", which is "Close" while the port is open."""
        if self.serial is None:
            self.open(self.port, 115200)
        else:
            self.close()

    def _monitor(self):
        """Does what the window does several times a second."""
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
        """Waits until bCNC's own questions have been answered. bCNC asks them when the machine comes to rest. If a job
        has begun meanwhile, it counts these answers for the job, and ends the job too early."""
        count = None
        while not self.queue.empty() or count != len(self.heard):
            count = len(self.heard)
            time.sleep(1)

    def start(self, lines=None):
        """Presses the button "Start": sends the loaded file, or these lines."""
        assert self.serial and not self.running
        self._settle()
        self.cleanAfter = True
        # This large number tells bCNC's thread that more lines will come.
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
        """Returns one of bCNC's variables."""
        return CNC.vars[name]

    @staticmethod
    def put(name, value):
        CNC.vars[name] = value
