from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import MotionErrorCode
from hal.api import MotionStatus


def test_a_hand_that_closes_on_nothing_succeeds_and_holds_nothing(simulate):
    simulated = simulate()
    handle = simulated.wait(simulated.gripper.close())
    assert handle.status is MotionStatus.SUCCEEDED
    assert not handle.result.object_held
    assert handle.result.width < 0.003
    assert not simulated.gripper.pressing()


def test_a_hand_that_closes_on_a_bar_holds_something_as_wide(simulate, world_with_bar):
    simulated = simulate(world=world_with_bar)
    handle = simulated.wait(simulated.gripper.close(force=30.0))
    assert handle.status is MotionStatus.SUCCEEDED
    assert handle.result.object_held
    assert handle.result.width == pytest.approx(0.03, abs=0.002)
    assert simulated.gripper.pressing()


def test_a_release_opens_slowly_and_only_a_little(simulate, world_with_bar):
    simulated = simulate(world=world_with_bar)
    simulated.wait(simulated.gripper.close())
    widths = [simulated.gripper.width()]
    handle = simulated.wait(simulated.gripper.release(), each=lambda: widths.append(simulated.gripper.width()))
    assert handle.status is MotionStatus.SUCCEEDED
    assert not simulated.gripper.pressing()
    assert simulated.gripper.width() == pytest.approx(widths[0] + 0.016, abs=0.002)
    assert np.diff(widths).max() < 0.02 * 0.05 * 1.5


@pytest.mark.slow
def test_opening_to_a_width_ends_there(simulate):
    simulated = simulate()
    simulated.wait(simulated.gripper.close())
    handle = simulated.wait(simulated.gripper.open(0.05))
    assert handle.result.width == pytest.approx(0.05, abs=0.002)


def test_a_width_beyond_the_range_is_refused(simulate):
    simulated = simulate()
    handle = simulated.gripper.open(0.5)
    assert handle.status is MotionStatus.FAILED
    assert handle.failure.code is MotionErrorCode.REFUSED


@pytest.mark.slow
def test_a_slip_watch_is_silent_while_it_holds_and_speaks_when_it_does_not(simulate, world_with_bar):
    simulated = simulate(world=world_with_bar)
    simulated.wait(simulated.gripper.close(force=30.0))
    watch = simulated.gripper.watch_slip()
    simulated.robot.clock.sleep(0.5)
    assert watch() is None
    simulated.wait(simulated.gripper.release())
    assert "no longer holds anything" in watch()
