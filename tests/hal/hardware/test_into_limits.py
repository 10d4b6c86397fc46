"""Joints outside of their range are brought back into it slowly, those within stay where they are."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hal.hardware.into_limits import admit_outside, execute_return, return_motions
from hal.parts.stop_latch import StopLatch
from hal.parts.streamed_joints import StreamedJointGroup
from tests.hal.parts.test_streamed_joints import MODEL, PERIOD, Joints


@pytest.mark.parametrize(("place", "end"), [([1.99, 1.7], [1.99, 1.48]), ([-2.4, 0.0], [-1.98, 0.0])])
def test_joints_outside_of_their_range_go_back_slowly_and_the_others_stay(place: list[float], end: list[float]) -> None:
    channel = Joints(2)
    channel.at = np.array(place)
    group = StreamedJointGroup("head", MODEL, channel, StopLatch(), PERIOD)

    def sleep(seconds: float) -> None:
        for _ in range(round(seconds / PERIOD)):
            group.cycle(PERIOD)

    clock = SimpleNamespace(sleep=sleep)
    robot: Any = SimpleNamespace(parts={"head": group}, part=lambda name, kind: group, clock=clock)
    admit_outside(robot)
    group.attach()
    (way,) = return_motions(robot)
    assert way.there == pytest.approx(end)
    assert str(way).count("from") == 1
    assert execute_return(robot, way) == ""
    assert channel.at == pytest.approx(end)
    assert np.max(np.abs(np.diff([place for place, _ in channel.sent], axis=0))) <= 0.0501 * MODEL.velocity[0] * PERIOD
    assert list(return_motions(robot)) == []
