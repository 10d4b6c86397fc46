"""Protective stops and other states of a UR that need a person, and their release, through a separate connection to the
dashboard server.

The dashboard server demands: "Always inspect cause of protective stop before unlocking". So neither connecting nor
``clear_stop()`` uses this module, only ``bestman-bt robot release``.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from hal.parts.part_connection import ConnectionFailedError

UNLOCK_TIME, POWER_TIME = 7.0, 20.0
"""Seconds for a release: a protective stop cannot be unlocked for 5 s, and powering on and releasing the brakes takes
time.
"""
AT_THE_ROBOT = ("EMERGENCY", "SAFEGUARD")


class URRelease:
    """Queries and releases one controller. ``timeout``: seconds for the connection."""

    def __init__(self, name: str, address: str, timeout: float) -> None:
        self._name, self._address, self._timeout = name, address, timeout

    def cause(self) -> str | None:
        """Return the required inspection as text, or None if the arm is released. Raises ConnectionFailedError."""
        with self._dashboard() as dashboard:
            causes = [
                f"{what} {state.replace('_', ' ').lower()}"
                for what, state, well in (
                    ("safety:", _state(dashboard.safetymode()), ("NORMAL", "REDUCED")),
                    ("arm:", _state(dashboard.robotmode()), ("RUNNING",)),
                )
                if state not in well
            ]
        return ", ".join(causes) or None

    def release(self) -> None:
        """Unlock or restart safety, power on, release the brakes.

        Raises ConnectionFailedError if that does not help.
        """
        with self._dashboard() as dashboard:
            safety = dashboard.safetymode()
            if any(word in safety for word in AT_THE_ROBOT):
                raise ConnectionFailedError(f"{self._name}: it has to be released at the robot: {_state(safety)}")
            if "PROTECTIVE" in safety:
                dashboard.closeSafetyPopup()
                self._await(lambda: _unlocked(dashboard), UNLOCK_TIME, "the protective stop cannot be unlocked")
            elif "VIOLATION" in safety or "FAULT" in safety:
                dashboard.closeSafetyPopup()
                dashboard.restartSafety()
            self._await(lambda: _powered(dashboard), POWER_TIME, "the arm does not become ready")

    @contextmanager
    def _dashboard(self) -> Iterator[Any]:
        try:
            from dashboard_client import DashboardClient

            dashboard = DashboardClient(self._address)
            dashboard.connect(int(1000 * self._timeout))
            try:
                yield dashboard
            finally:
                dashboard.disconnect()
        except ConnectionFailedError:
            raise
        except Exception as error:  # the SDK raises nothing narrower, and its words name the address
            raise ConnectionFailedError(f"{self._name}: the UR controller's dashboard does not answer") from error

    def _await(self, done: Callable[[], bool], limit: float, otherwise: str) -> None:
        deadline = time.monotonic() + limit
        while not done():
            if time.monotonic() > deadline:
                raise ConnectionFailedError(f"{self._name}: {otherwise}")
            time.sleep(0.1)


def _state(answer: str) -> str:
    return answer.partition(":")[2].strip()


def _unlocked(dashboard: Any) -> bool:
    try:
        dashboard.unlockProtectiveStop()
    except Exception:  # noqa: BLE001 - it refuses for the first seconds, in words only
        return False
    return True


def _powered(dashboard: Any) -> bool:
    mode = dashboard.robotmode()
    if "RUNNING" in mode:
        return True
    if "POWER_OFF" in mode:
        dashboard.powerOn()
    elif "IDLE" in mode:
        dashboard.brakeRelease()
    return False
