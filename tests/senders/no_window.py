"""A `tkinter` and a `wx` without windows: each name is a class that does nothing. With them, modules of bCNC and printrun
that draw windows can be imported on a machine without a display."""

import sys
import types


class _Windows(types.ModuleType):
    TkVersion = TclVersion = 8.6
    __path__ = []

    @staticmethod
    def get_space(_):
        """The space around a widget of printrun."""
        return 0

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        thing = type(name, (Exception if name.endswith("Error") else object,), {})
        setattr(self, name, thing)
        return thing


TK = ["tkinter", "tkinter.font", "tkinter.colorchooser", "tkinter.messagebox", "tkinter.ttk"]
WX = ["wx", "printrun.gui", "printrun.gui.widgets"]


def install(names=TK):
    """Makes `import` find this module for these names."""
    for name in names:
        sys.modules[name] = _Windows(name)
        if "." in name:
            setattr(sys.modules[names[0]], name.rsplit(".", 1)[1], sys.modules[name])
