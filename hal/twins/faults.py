"""Faults on demand: what can go wrong with a controller, switched on and off while it runs."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class WireFaults:
    """What is wrong with the wire now. ``silent``: nothing arrives and nothing is sent, as if the cable was pulled."""

    silent: bool = False
    delay: float = 0.0


class Faults:
    """The faults of one connection.

    Of the wire: ``drop`` (silence), ``delay`` (seconds, 0.2 if nothing is said), ``restore``. Others, which the
    twin of the controller adds by ``offer``, happen to the machine: ``protective_stop``, ``joint_limit``, …
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._wire = WireFaults()
        self._offered: dict[str, Callable[[], None]] = {}

    @property
    def wire(self) -> WireFaults:
        """The state of the wire."""
        return self._wire

    @property
    def names(self) -> list[str]:
        """What can be asked for."""
        return ["drop", "delay", "restore", *self._offered]

    def offer(self, faults: Mapping[str, Callable[[], None]]) -> None:
        """Let further faults be asked for by name."""
        self._offered |= faults

    def happen(self, name: str, value: float | None = None) -> None:
        """Make a fault happen now; LookupError names what there is."""
        with self._lock:
            if name == "drop":
                self._wire = WireFaults(silent=True)
            elif name == "delay":
                self._wire = WireFaults(delay=0.2 if value is None else float(value))
            elif name == "restore":
                self._wire = WireFaults()
            elif name in self._offered:
                self._offered[name]()
            else:
                raise LookupError(f"no fault {name!r}; there are {', '.join(self.names)}")
