"""Takes the place of the packages that gscrib needs for height maps, curves and turned coordinates. A job of lines
uses none of these. Its `linalg` is that of numpy."""

import sys
import types
import unittest.mock

import numpy

NAMES = ["scipy", "scipy.interpolate", "scipy.spatial", "scipy.spatial.transform", "skimage", "cv2"]


class _Nothing(types.ModuleType):
    __path__ = []
    linalg = numpy.linalg

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return unittest.mock.Mock


def install():
    """Makes these packages importable."""
    sys.modules.update((name, _Nothing(name)) for name in NAMES)
