"""Faults of a controller that can be switched on and off while it runs."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass

LONGEST_DELAY = 60.0
"""Seconds."""


def delay_seconds(value: object) -> float:
    """Return the value of a fault ``delay``, seconds. Raises ValueError naming the accepted range."""
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        with contextlib.suppress(ValueError):
            seconds = float(value)
            if 0.0 <= seconds <= LONGEST_DELAY:
                return seconds
    got = "nothing" if value is None else repr(value)
    raise ValueError(f"a delay should be 0 to {LONGEST_DELAY:g} seconds (CONNECTION:delay:0.2), got {got}")


def _share(name: str, value: object) -> float:
    with contextlib.suppress(TypeError, ValueError):
        share = float(str(value))
        if 0.0 <= share <= 1.0:
            return share
    raise ValueError(f"{name} should be 0 to 1 (CONNECTION:{name}:0.5), got {value!r}")


@dataclass(frozen=True)
class WireFaults:
    """The current faults of the wire. ``silent``: nothing arrives or is sent, as with an unplugged cable."""

    silent: bool = False
    delay: float = 0.0


class Faults:
    """The faults of one connection.

    Faults of the wire: ``drop`` (silence), ``delay`` (with a value: seconds from 0 to ``LONGEST_DELAY``), ``restore``.
    Others, which the controller's twin adds by ``offer``, are faults of the machine: ``protective_stop``, …
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._wire = WireFaults()
        self._offered: dict[str, Callable[[], None]] = {}
        self._shares: dict[str, Callable[[float], None]] = {}

    @property
    def wire(self) -> WireFaults:
        """The state of the wire."""
        return self._wire

    @property
    def names(self) -> list[str]:
        """Return the available faults."""
        return ["drop", "delay", "restore", *self._offered, *self._shares]

    def add(
        self, faults: Mapping[str, Callable[[], None]], shares: Mapping[str, Callable[[float], None]] | None = None
    ) -> None:
        """Add further faults by name. ``shares``: those with a value from 0 to 1."""
        self._offered |= faults
        self._shares |= shares or {}

    def trigger(self, name: str, value: float | None = None) -> None:
        """Trigger a fault. Raises LookupError listing the faults, ValueError naming the accepted ``value``."""
        if name == "delay":
            value = delay_seconds(value)
        elif name in self._shares:
            value = _share(name, value)
        elif value is not None:
            raise ValueError(f"the fault {name!r} takes no value, got {value!r}")
        with self._lock:
            if name == "drop":
                self._wire = WireFaults(silent=True)
            elif name == "delay":
                self._wire = WireFaults(delay=value or 0.0)
            elif name == "restore":
                self._wire = WireFaults()
            elif name in self._offered:
                self._offered[name]()
            elif name in self._shares and value is not None:
                self._shares[name](value)
            else:
                raise LookupError(f"no fault {name!r}; there are {', '.join(self.names)}")
