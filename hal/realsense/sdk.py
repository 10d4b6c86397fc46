"""Imports pyrealsense2, whose wheel expects the system's libusb."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from types import ModuleType


def realsense_sdk(load: Callable[[str], ModuleType]) -> ModuleType:
    """The SDK; ``load`` imports a module, and raises ConnectionFailedError where it cannot.

    Slim systems have no libusb: the one that the extra brings is loaded first, under the name that the SDK looks for.
    """
    libusb = load("libusb_package").get_library_path()
    if libusb is not None:
        ctypes.CDLL(str(libusb), mode=ctypes.RTLD_GLOBAL)
    return load("pyrealsense2")
