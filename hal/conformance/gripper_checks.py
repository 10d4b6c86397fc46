"""Checks of grippers: requested widths, and motions that can be cancelled."""

from __future__ import annotations

from hal.api import Gripper, MotionStatus, Robot
from hal.conformance.requirement import require
from hal.conformance.subject import GRIPPERS, Check, each, finish


@each(Gripper)
def motions_of_grippers_can_be_cancelled(robot: Robot, gripper: Gripper) -> None:
    """Check that cancelled motions end at once, and that the fingers come to rest."""
    motion = gripper.move(_other_end(gripper))
    robot.clock.sleep(0.1)
    require(not motion.done, "a motion over the whole range ended within 0.1 s")
    motion.cancel()
    require(motion.status is MotionStatus.CANCELED, f"right after cancel() a motion is {motion.status}")
    robot.clock.sleep(0.5)
    before = gripper.width()
    robot.clock.sleep(0.5)
    moved = abs(gripper.width() - before)
    require(moved < 0.002 and not gripper.state().moving, f"{gripper.name} still moved by {moved:.4f} m")


@each(Gripper)
def a_gripper_opens_and_closes(robot: Robot, gripper: Gripper) -> None:
    """Check that a gripper reaches the requested widths and, closed without an object, reports none."""
    closed, opened = gripper.model.part.min_width, gripper.model.max_width
    middle = (closed + opened) / 2
    for command, width, empty in (
        (gripper.open, opened, False),
        (gripper.close, closed, True),
        (lambda: gripper.move(middle), middle, False),
    ):
        motion = command()
        finish(robot, motion)
        state = gripper.state()
        ended = f"the gripper's motion ended {motion.status}: {motion.failure}"
        require(motion.status is MotionStatus.SUCCEEDED, ended)
        require(abs(gripper.width() - width) < 0.003, f"the width is {gripper.width():.4f}, asked were {width:.4f}")
        require(state.at_target and not state.moving and not state.object_held, f"unexpected state {state}")
        require(state.empty == empty, f"at width {width} the state is {state}")


def _other_end(gripper: Gripper) -> float:
    """Return the width at the end of its range that is farther away."""
    closed, opened = gripper.model.part.min_width, gripper.model.max_width
    return opened if 2 * gripper.width() < closed + opened else closed


GRIPPER_CHECKS = (
    Check(motions_of_grippers_can_be_cancelled, GRIPPERS, commands=True),
    Check(a_gripper_opens_and_closes, GRIPPERS, commands=True),
)
