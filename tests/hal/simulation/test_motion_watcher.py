"""What the monitor notes: joints beyond their limits, by joint states that a test writes, and reads of the truth."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from bestman_bt.robot_model.model import ArmModel
from hal.simulation.audit_record import CallCounter
from hal.simulation.guards import GuardedEngine, Reader, ReadPurpose
from hal.simulation.motion_watcher import LIMIT_TOLERANCE, MotionWatcher
from hal.simulation.observation import SimulationState
from hal.simulation.robot import SimulatedRobot


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_joint_beyond_its_limits_is_reported_once_whichever_limit_that_is(
    standing_robot: SimulatedRobot, side: float
) -> None:
    simulation, (arm,) = standing_robot.simulation, standing_robot.model.of(ArmModel).values()
    watcher = MotionWatcher(simulation, simulation.reader(ReadPurpose.MONITOR))
    slot = simulation.slots(arm.joint_names)[2]
    limit, speed = (arm.upper if side > 0.0 else arm.lower)[2], side * arm.velocity[2]
    for beyond, count in ((0.9, 0), (1.1, 1), (1.2, 1), (0.9, 1), (1.1, 2)):
        joints = simulation.joint_states().copy()
        joints[0, slot] = limit + side * beyond * LIMIT_TOLERANCE
        joints[1, slot] = (1.0 + 0.1 * (beyond > 1.0)) * speed
        watcher.watch_limits(SimulationState(0.0, {}, [], joints, {}))
        assert (len(watcher.joint_limits), len(watcher.velocity_limits)) == (count, count)


def test_a_view_of_the_truth_is_free_for_who_has_opened_it_before_it_was_closed() -> None:
    engine: Any = SimpleNamespace(ledger=CallCounter(), built=SimpleNamespace(robot=1), body_pose=lambda body: body)
    engine.ledger.seal()
    early, foreign = (Reader(engine, GuardedEngine(engine), ReadPurpose.SCRIPT, who) for who in (__name__, "other"))
    engine.ledger.close_truth()
    late = Reader(engine, GuardedEngine(engine), ReadPurpose.SCRIPT, __name__)
    for reader, count in ((early, 0), (foreign, 1), (late, 2)):
        assert reader.body_pose(7) == 7
        assert engine.ledger.counts["truth_reads"] == count
