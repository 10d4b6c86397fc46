"""The checks as pytest tests: inherit both classes and give them a robot.

A fixture ``make_robot`` returns a function that makes one, not connected::

    class TestMyRobot(PromisesOfAConnectedRobot): ...

    class TestMyRobotsConnection(PromisesAboutConnecting): ...

    @pytest.fixture(scope="module")
    def make_robot():
        return lambda: MyRobot(model)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from hal.api import Robot
from hal.conformance import CHECKS, LIFE_CHECKS
from hal.conformance.subject import Check, settle
from hal.pytest_plugin import MISSING, NOT_APPLICABLE

Properties = Callable[[str, object], None]
MakeRobot = Callable[[], Robot]


class PromisesOfAConnectedRobot:
    """Checks that share one connected robot, which comes to rest after each of them."""

    @pytest.fixture(scope="class")
    @classmethod
    def connected_robot(cls, make_robot: MakeRobot) -> Iterator[Robot]:
        """Yield the robot under test."""
        with make_robot() as robot:
            yield robot

    @pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.name)
    def test_a_connected_robot_keeps_its_promise(
        self, check: Check, connected_robot: Robot, record_property: Properties
    ) -> None:
        """Run one check; inapplicable ones are skipped and listed at the end."""
        skip_inapplicable_checks(check, connected_robot, record_property)
        try:
            check.run(connected_robot)
        finally:
            settle(connected_robot)


class PromisesAboutConnecting:
    """Checks of connecting; each gets a new robot, and no other client is connected meanwhile."""

    @pytest.mark.parametrize("check", LIFE_CHECKS, ids=lambda check: check.name)
    def test_a_robot_keeps_its_promise_about_connections(
        self, check: Check, make_robot: MakeRobot, record_property: Properties
    ) -> None:
        """Run one check; the robot is disconnected afterwards in any case."""
        robot = make_robot()
        skip_inapplicable_checks(check, robot, record_property)
        try:
            check.run(robot)
        finally:
            robot.disconnect()

    def test_what_is_declared_missing_has_a_reason(self, make_robot: MakeRobot, record_property: Properties) -> None:
        """Check that everything declared unsupported has a reason, and list it at the end."""
        robot = make_robot()
        for what, why in robot.unsupported.items():
            record_property(MISSING, f"{_title(robot)}: {what}: {why}")
        unexplained = [what for what, why in robot.unsupported.items() if not why.strip()]
        assert not unexplained, f"{', '.join(unexplained)}: declared missing without a reason"


def skip_inapplicable_checks(check: Check, robot: Robot, record_property: Properties) -> None:
    """Skip a check that does not apply to a robot, and record it for the list."""
    why = check.why_not(robot)
    if why is not None:
        record_property(NOT_APPLICABLE, f"{_title(robot)}: {check.name}: {why}")
        pytest.skip(f"does not apply: {why}")


def _title(robot: Robot) -> str:
    return f"{type(robot).__name__} ({robot.model.name})"
