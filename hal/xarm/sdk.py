"""The vendor's SDK, unmodified, with its side effects kept from the rest of the process."""

from __future__ import annotations

import contextlib
import io
import logging
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any, TextIO


class _SilentHere(io.TextIOBase):
    """A standard output that swallows what one thread writes and passes on what others do."""

    def __init__(self, original: TextIO) -> None:
        self._original, self._thread = original, threading.get_ident()

    def write(self, text: str) -> int:
        if threading.get_ident() == self._thread:
            return len(text)
        return self._original.write(text)

    def flush(self) -> None:
        self._original.flush()


@contextlib.contextmanager
def discreet() -> Iterator[None]:
    """While the SDK is imported or connects: it prints the controller's address, and changes all sockets' timeout."""
    timeout = socket.getdefaulttimeout()
    try:
        with contextlib.redirect_stdout(_SilentHere(sys.stdout)):
            yield
    finally:
        socket.setdefaulttimeout(timeout)


def import_sdk(load: Callable[[str], ModuleType]) -> Any:
    """The package ``xarm``; its log, which names the address, is kept for what is critical."""
    with discreet():
        package = load("xarm")
        log = load("xarm.core.utils.log")
    log.logger.setLevel(logging.CRITICAL)
    logging.getLogger("origin.print").setLevel(logging.CRITICAL)
    return package
