"""A `tkinter` without windows: each name is a class that does nothing. With it, modules of bCNC that draw windows can
be imported on a machine without a display and without Tk."""

import sys
import types


class _Windows(types.ModuleType):
    TkVersion = TclVersion = 8.6
    __path__ = []

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        thing = type(name, (Exception if name.endswith("Error") else object,), {})
        setattr(self, name, thing)
        return thing


def install():
    """Makes `import tkinter` find this module."""
    for name in ["tkinter", "tkinter.font", "tkinter.colorchooser", "tkinter.messagebox", "tkinter.ttk"]:
        sys.modules[name] = _Windows(name)
        if "." in name:
            setattr(sys.modules["tkinter"], name.split(".")[1], sys.modules[name])
