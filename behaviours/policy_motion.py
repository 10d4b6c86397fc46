"""The arm and the gripper under a policy: one motion that goes on from chunk to chunk, watched and stopped."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from behaviours.computation import TimeSource
from behaviours.context import SkillContext
from behaviours.skill import SkillFailure, Steps, StepsTo
from behaviours.waiting import Until
from bestman_bt.control import MotionStatus
from bestman_bt.manipulation.trajectory import SpeedScale
from bestman_bt.messages import Pose

if TYPE_CHECKING:
    from bestman_bt.control import Motion
    from bestman_bt.control.gripper import GripperOutcome
    from bestman_bt.manipulation.policy import ActionChunk, StreamedMotion, Workspace

POLICY_SPEED = SpeedScale(0.5, 0.35)
OUTSIDE = 0.02
"""Metres by which the measured tool may leave the box before the arm is stopped: its plans may not leave it at all."""
CLOSED = 0.002
"""Metres of gripper width below which a policy means: close; also by how much another width differs."""


class PolicyMotion:
    """What a policy has set in motion, by the clock's ``deadline`` and with the tool in ``box``.

    ``closed_at``: base_from_tool when the gripper was last told to close. Nothing moves after ``cancel``.
    """

    def __init__(self, skills: SkillContext, box: Workspace, deadline: float) -> None:
        from bestman_bt.manipulation.policy import ChunkStream

        self._skills, self.box, self.deadline = skills, box, deadline
        self.stream = ChunkStream(skills.arm_model, speed=POLICY_SPEED)
        self.closed_at: Pose | None = None
        self._arm: Motion[None] | None = None
        self._fingers: Motion[GripperOutcome] | None = None
        self._width = skills.gripper.width()
        self._chunk: tuple[ActionChunk, float] | None = None

    @property
    def asked_width(self) -> float:
        """What the gripper was told last, metres."""
        return self._width

    def asked(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions and velocities that the arm is asked to have now, (n,) each; at rest, where it is.

        Deltas that are added to what was asked make up for what gravity and lag take away, and what encoders tell of
        velocities is coarse.
        """
        now, motion = self._skills.clock.now(), self.stream.motion
        if motion is not None and self.stream.moving(now):
            state = motion.state(now)
            return state.positions, state.velocities
        positions = self._skills.arm_positions()
        return positions, np.zeros(len(positions))

    def follow(self, spliced: StreamedMotion) -> None:
        """Go on along a checked motion; StaleChunkError where it is too late for it."""
        trajectory = self.stream.accept(spliced, self._skills.clock.now())
        self._arm = self._skills.arm.follow(trajectory, guard=self._objection)

    def carry_out(self, chunk: ActionChunk, seen: float, count: int) -> StepsTo[bool]:
        """Until ``count`` actions of the chunk are over, which began at ``seen``; returns whether the gripper moved."""
        self._chunk = chunk, seen
        return (yield from self._until(seen + max(1, count) * chunk.dt))

    def finish(self) -> Steps:
        """Until the motion under way is at rest."""
        if self.stream.motion is not None:
            yield from self._until(self.stream.motion.end)
        while self._arm is not None and not self._arm.done:
            yield from self._until(self._skills.clock.now() + 1e-3)

    def cancel(self) -> None:
        """Bring arm and fingers to rest; what is held stays held."""
        for handle in (self._arm, self._fingers):
            if handle is not None:
                handle.cancel()

    def _until(self, time: float) -> StepsTo[bool]:
        clock, acted = self._skills.clock, False
        while True:
            self._watch()
            acted = self._move_gripper() or acted
            if clock.now() >= time - 1e-9:
                return acted
            yield _next_tick(clock)

    def _watch(self) -> None:
        """Raise where arm or gripper has failed."""
        for handle in (self._arm, self._fingers):
            if handle is not None and handle.done and handle.status is not MotionStatus.SUCCEEDED:
                failure = handle.failure
                if failure is not None and failure.code == "guarded" and self._skills.clock.now() >= self.deadline:
                    raise SkillFailure("timeout", "stopped in the middle of a chunk: not there in time")
                raise SkillFailure.of(failure)

    def _objection(self) -> str | None:
        if self._skills.clock.now() >= self.deadline:
            return "time is up"
        position = self._skills.base_from_tool().position
        if self.box.contains(position, OUTSIDE):
            return None
        return f"the tool has left the workspace at {np.round(position, 3).tolist()}"

    def _move_gripper(self) -> bool:
        """Tell the gripper what the chunk says for now, where that is new; returns whether it moves."""
        gripper = self._skills.gripper
        moving = self._fingers is not None and not self._fingers.done
        if self._chunk is None or self._chunk[0].gripper_widths is None:
            return moving
        chunk, seen = self._chunk
        widths = self._chunk[0].gripper_widths
        index = min(int((self._skills.clock.now() - seen) / chunk.dt), len(widths) - 1)
        width = float(np.clip(widths[index], 0.0, gripper.model.max_width))
        if abs(width - self._width) <= CLOSED:
            return moving
        self._width = width
        if width < CLOSED:
            self.closed_at = self._skills.base_from_tool()
            self._fingers = gripper.close()
        else:
            self._fingers = gripper.open(width)
        return True


def _next_tick(clock: TimeSource) -> Until:
    now = clock.now()
    return Until(lambda: clock.now() > now)
