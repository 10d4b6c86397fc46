"""An xArm through the vendor's SDK keeps the promises of hal.conformance, as far as it has the parts."""

from __future__ import annotations

import pytest

from hal.conformance.promises import MakeRobot, PromisesAboutConnecting, PromisesOfAConnectedRobot
from tests.hal.twinned import why_checks_do_not_apply

pytestmark = [pytest.mark.real_time, pytest.mark.slow]


class TestConnected(PromisesOfAConnectedRobot):
    pass


class TestConnecting(PromisesAboutConnecting):
    pass


def test_nothing_but_parts_that_it_has_not_is_missing(make_robot: MakeRobot) -> None:
    reasons = why_checks_do_not_apply(make_robot)
    assert all(reason.startswith(("the robot has no ", "it is behind no connection")) for reason in reasons)
