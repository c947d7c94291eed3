"""A `tkinter` without windows, so that modules of bCNC which draw them can be imported on a machine that has no
display and no Tk: each name is a class that does nothing."""

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
    """Has `import tkinter` find it."""
    for name in ["tkinter", "tkinter.font", "tkinter.colorchooser", "tkinter.messagebox", "tkinter.ttk"]:
        sys.modules[name] = _Windows(name)
        if "." in name:
            setattr(sys.modules["tkinter"], name.split(".")[1], sys.modules[name])
