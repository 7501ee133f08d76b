"""Exit 1 where a shared library that the wheels of Open3D and PyMeshLab load is missing; standard library only."""

import ctypes
import sys

NEEDED = ("libGL.so.1", "libEGL.so.1", "libOpenGL.so.0", "libusb-1.0.so.0")


def missing() -> list[str]:
    absent = []
    for name in NEEDED:
        try:
            ctypes.CDLL(name)
        except OSError:
            absent.append(name)
    return absent


if __name__ == "__main__" and sys.platform == "linux" and missing():
    print("missing:", ", ".join(missing()), file=sys.stderr)
    raise SystemExit(1)
