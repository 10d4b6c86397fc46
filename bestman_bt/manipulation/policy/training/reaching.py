"""Demonstrations of reaching, and runs of its policies: inverse kinematics, without a simulator.

An expert demonstrates the first H steps of the motion to the nearest solution of the tool goal; then again from there,
still moving, slightly perturbed, so that the imitator learns corrections (Laskey et al., "DART: noise injection for
robust imitation learning", CoRL 2017).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.manipulation.policy.base import Observation, Policy
from bestman_bt.manipulation.policy.chunk_stream import chunk_path
from bestman_bt.manipulation.policy.errors import PolicyError
from bestman_bt.manipulation.policy.features import pose_error, pose_vector
from bestman_bt.manipulation.policy.specification import PolicySpecification
from bestman_bt.manipulation.policy.training.demonstrations import Demonstration
from bestman_bt.manipulation.trajectory.base import SpeedScale
from bestman_bt.manipulation.trajectory.ruckig import RuckigStateToState
from bestman_bt.messages import JointTrajectory, Pose
from bestman_bt.robot_model.model import ArmModel

REACHING_FEATURES = ("joint_positions", "joint_velocities", "goal_error")


@dataclass(eq=False)
class ReachingExpert:
    """Starts, goals and demonstrations for one arm; all randomness comes from the given generator.

    ``lower``, ``upper``: corners of the tool's box in the base frame, metres. ``max_yaw``, ``max_tilt``: largest
    rotation of the tool from that in ``posture``, radians. ``posture_noise``: noise of the joints at the start of a
    search, rad. ``horizon``: actions of ``dt`` seconds per chunk, of which ``executed`` are executed. ``chunks``: per
    episode. ``drift``: largest perturbation after each, rad. ``near``: fraction of the episodes that begin next to
    their goal. ``margin``: metres of the workspace around the goals' box.
    """

    kinematics: InverseKinematics
    arm: ArmModel
    home: NDArray[np.float64]
    lower: tuple[float, float, float] = (0.42, -0.30, 0.82)
    upper: tuple[float, float, float] = (0.65, 0.30, 1.15)
    max_yaw: float = 0.5
    max_tilt: float = 0.15
    posture: str = "home"
    posture_noise: float = 0.1
    horizon: int = 10
    dt: float = 0.08
    executed: int = 5
    chunks: int = 8
    drift: float = 0.015
    near: float = 0.3
    margin: float = 0.10
    speed: SpeedScale = field(default_factory=lambda: SpeedScale(0.4, 0.25))
    _motion: RuckigStateToState = field(default_factory=RuckigStateToState, init=False, repr=False)

    def specification(self, robot: str) -> PolicySpecification:
        """Return the specification of a policy trained on these demonstrations."""
        low, high = np.array(self.lower) - self.margin, np.array(self.upper) + self.margin
        return PolicySpecification(
            joint_names=self.arm.joint_names,
            space="joint_deltas",
            horizon=self.horizon,
            dt=self.dt,
            executed=self.executed,
            robot=robot,
            workspace=(tuple(low.tolist()), tuple(high.tolist())),
            description="moves the tool to the goal pose; trained by behaviour cloning of reaching",
        )

    def task(self, rng: np.random.Generator, near: bool = False) -> tuple[NDArray[np.float64], Pose]:
        """Draw joint positions (n,), radians, and a goal (base frame), both in the box. ``near``: the goal is within a
        few centimetres of the start."""
        while True:
            start = self._posture(self._pose(rng), rng)
            goal = self._pose(rng)
            if start is not None and near:
                turn = rng.uniform(-1.0, 1.0, 3) * 0.12
                tool = self.kinematics.tool_pose(start)
                goal = (
                    Pose(tool.position + rng.uniform(-0.04, 0.04, 3) * rng.uniform())
                    @ Pose.from_xyz_rpy(np.zeros(3), turn * rng.uniform())
                    @ Pose(np.zeros(3), tool.quaternion)
                )
            if start is not None and self.motion(start, goal, rng) is not None:
                return start, goal

    def motion(
        self,
        start: NDArray[np.float64],
        goal: Pose,
        rng: np.random.Generator,
        velocity: NDArray[np.float64] | None = None,
    ) -> JointTrajectory | None:
        """Return the expert's motion from ``start`` to the nearest solution for ``goal``, or None if there is none.

        ``velocity``: (n,) rad/s at the start (default: at rest).
        """
        found = self.kinematics.solve(goal, start, rng, attempts=1)
        if not found.found:
            return None
        try:
            return self._motion.plan(start, found.best, self.arm, self.speed, start_velocity=velocity)
        except ManipulationError:
            return None

    def demonstrate(self, rng: np.random.Generator) -> Demonstration:
        """Return one episode. Raises PolicyError."""
        positions, goal = self.task(rng, near=bool(rng.uniform() < self.near))
        velocities = np.zeros(len(positions))
        observations, chunks = [], []
        for _ in range(self.chunks):
            motion = self.motion(positions, goal, rng, velocities)
            if motion is None:
                break
            tool = self.kinematics.tool_pose(positions)
            observations.append(Observation(positions, tool, pose_vector(goal), joint_velocities=velocities))
            times = np.arange(self.horizon + 1) * self.dt
            samples = np.array([motion.sample(float(time))[0] for time in times])
            chunks.append(np.diff(samples, axis=0))
            positions, velocities = self._pushed(*motion.sample(float(times[self.executed])), rng)
        if not chunks:
            raise PolicyError("the expert found no motion to a goal that it had reached before")
        return Demonstration(tuple(observations), np.array(chunks))

    def _pushed(
        self, positions: NDArray[np.float64], velocities: NDArray[np.float64], rng: np.random.Generator
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return a little off, most often very little."""
        push = self.drift * rng.uniform() ** 2
        fastest = self.arm.velocity * self.speed.velocity
        return (
            np.clip(positions + rng.normal(0.0, push, len(positions)), self.arm.lower + 0.03, self.arm.upper - 0.03),
            np.clip(velocities + rng.normal(0.0, 2.0 * push, len(positions)), -fastest, fastest),
        )

    def _pose(self, rng: np.random.Generator) -> Pose:
        straight = self.kinematics.tool_pose(self.home).quaternion
        tilt_axis, tilt = rng.uniform(-math.pi, math.pi), rng.uniform(0.0, self.max_tilt)
        turn = Pose.from_xyz_rpy(
            rng.uniform(self.lower, self.upper),
            (tilt * math.cos(tilt_axis), tilt * math.sin(tilt_axis), rng.uniform(-self.max_yaw, self.max_yaw)),
        )
        return turn @ Pose(np.zeros(3), straight)

    def _posture(self, pose: Pose, rng: np.random.Generator) -> NDArray[np.float64] | None:
        reference = self.home + rng.normal(0.0, self.posture_noise, len(self.home))
        found = self.kinematics.solve(pose, np.clip(reference, self.arm.lower, self.arm.upper), rng, attempts=1)
        return found.best if found.found else None


@dataclass(frozen=True, eq=False)
class Rollout:
    """``path``: (N, n) radians; ``errors``: (C, 2) metres and radians to the goal after each chunk."""

    path: NDArray[np.float64]
    errors: NDArray[np.float64]

    def reached(self, position_tolerance: float, rotation_tolerance: float) -> bool:
        """Return whether the tool was at the goal after some chunk."""
        return bool((self.errors <= (position_tolerance, rotation_tolerance)).all(axis=1).any())


def roll_out(
    policy: Policy,
    kinematics: InverseKinematics,
    arm: ArmModel,
    start: NDArray[np.float64],
    goal: Pose,
    judged: Pose | None = None,
    chunks: int = 16,
) -> Rollout:
    """Run a policy from ``start`` (n,), radians, to ``goal``. Errors are relative to ``judged`` (default: ``goal``)."""
    judged = judged or goal
    path, errors = [start], []
    velocities = np.zeros(len(start))
    policy.reset()
    for _ in range(chunks):
        tool = kinematics.tool_pose(path[-1])
        chunk = policy.act(Observation(path[-1], tool, pose_vector(goal), joint_velocities=velocities))
        steps = chunk_path(chunk, path[-1], kinematics, arm)
        done = policy.specification.executed or max(1, (len(steps) - 1) // 2)
        path.extend(steps[1 : done + 1])
        velocities = (steps[min(done + 1, len(steps) - 1)] - steps[done - 1]) / (2.0 * chunk.dt)
        error = pose_error(judged, kinematics.tool_pose(path[-1]))
        errors.append((np.linalg.norm(error[:3]), np.linalg.norm(error[3:])))
    return Rollout(np.array(path), np.array(errors))
