"""Demonstrations of picking: planned grasps, inverse kinematics and jerk-limited motions, without a simulator.

The expert decides at each step only from the observation: move above the object, descend as the hand gets aligned (a
funnel: Burridge, Rizzi and Koditschek, "Sequential composition of dynamically dexterous robot behaviors", IJRR 1999),
close, lift. Its state is perturbed after some steps (DART, Laskey et al., CoRL 2017).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import ruckig
from numpy.typing import NDArray

from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.manipulation.policy.base import ActionChunk, Observation, Policy
from bestman_bt.manipulation.policy.errors import PolicyError, PolicyObservationError
from bestman_bt.manipulation.policy.features import pose_error, pose_vector
from bestman_bt.manipulation.policy.specification import ActionSpace, PolicySpecification
from bestman_bt.manipulation.policy.training.demonstrations import Demonstration
from bestman_bt.manipulation.trajectory.base import SpeedScale
from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import ArmModel

Array = NDArray[np.float64]
PICKING_FEATURES = (
    "joint_positions",
    "joint_velocities",
    "tool_axes",
    "goal_offset",
    "goal_offset_near",
    "gripper_width",
)
OPEN, CLOSED = 1.0, -1.0
_STILL = 1e-7
"""rad, rad/s and rad/s² below which no motion is planned: ruckig fails on values as small as rounding errors."""
_LEVER = 0.05
"""Position error, metres, that is weighted like a rotation error of 1 rad."""


@dataclass(frozen=True)
class PickedObject:
    """The object of the expert, picked from above.

    ``rise``: metres from its middle up to the grasp; ``width``: metres between the fingers at the grasp; ``opening``:
    metres, of the gripper before closing.
    """

    name: str
    rise: float
    width: float
    opening: float


@dataclass(frozen=True, eq=False)
class PickState:
    """The arm, (n,) each, and the gripper's width in metres."""

    positions: Array
    velocities: Array
    accelerations: Array
    width: float


@dataclass(eq=False)
class PickingExpert:
    """Starts, objects and demonstrations for one arm; all randomness comes from the given generator.

    Metres, radians and seconds in the base frame.

    ``lower``, ``upper``: corners of the box of the object's middle; ``tool_lower``, ``tool_upper``: of the tool's
    starts, turned by ``max_yaw`` and ``max_tilt`` at most. ``slow``: rad/s below which the arm may close the gripper.
    ``hover``: height above the grasp; ``lift``: height of the lift. ``aligned``: largest lateral offset at which the
    hand descends fully; ``astray``: offset from which it stays above. ``at_grasp``: distance at which it closes.
    ``carrot``: lookahead distance of the arm's target. ``horizon`` actions of ``dt`` per chunk, of which ``executed``
    are executed; ``chunks``: maximum per episode. ``drift``: maximum random deviation from the path after each chunk,
    rad. ``margin``: margin of the workspace around both boxes.
    """

    kinematics: InverseKinematics
    arm: ArmModel
    home: Array
    picked: PickedObject
    lower: tuple[float, float, float] = (0.48, -0.30, 0.79)
    upper: tuple[float, float, float] = (0.74, 0.30, 0.81)
    tool_lower: tuple[float, float, float] = (0.38, -0.25, 0.98)
    tool_upper: tuple[float, float, float] = (0.62, 0.25, 1.15)
    max_yaw: float = 0.6
    max_tilt: float = 0.15
    hover: float = 0.09
    lift: float = 0.16
    aligned: float = 0.003
    astray: float = 0.014
    at_grasp: float = 0.004
    slow: float = 0.15
    carrot: float = 0.15
    posture: str = "home"
    posture_noise: float = 0.1
    horizon: int = 10
    dt: float = 0.08
    executed: int = 5
    chunks: int = 24
    drift: float = 0.012
    closing_speed: float = 0.1
    margin: float = 0.06
    speed: SpeedScale = field(default_factory=lambda: SpeedScale(0.3, 0.2))
    jerk_time: float = 0.1

    def __post_init__(self) -> None:
        self._ruckig = ruckig.Ruckig(len(self.home), self.dt)
        acceleration = self.arm.acceleration * self.speed.acceleration
        self._limits = self.arm.velocity * self.speed.velocity, acceleration, acceleration / self.jerk_time

    def specification(self, robot: str) -> PolicySpecification:
        """Return the specification of a policy trained on these demonstrations."""
        low = np.minimum(self.lower, self.tool_lower) - self.margin
        high = np.maximum(self.upper, self.tool_upper) + self.margin
        return PolicySpecification(
            joint_names=self.arm.joint_names,
            space="joint_deltas",
            horizon=self.horizon,
            dt=self.dt,
            executed=self.executed,
            robot=robot,
            moves_gripper=True,
            open_width=self.picked.opening,
            workspace=(tuple(low.round(4).tolist()), tuple(high.round(4).tolist())),
            description=f"picks the {self.picked.name}, whose pose is the goal; trained by behaviour cloning",
        )

    def task(self, rng: np.random.Generator) -> tuple[Array, Pose]:
        """Draw joint positions (n,), radians, and an object pose (base frame), both within their boxes."""
        goal = Pose.from_xyz_rpy(rng.uniform(self.lower, self.upper), (0.0, 0.0, rng.uniform(-math.pi, math.pi)))
        while True:
            axis, tilt = rng.uniform(-math.pi, math.pi), rng.uniform(0.0, self.max_tilt)
            turn = (tilt * math.cos(axis), tilt * math.sin(axis), rng.uniform(-self.max_yaw, self.max_yaw))
            tool = Pose.from_xyz_rpy(rng.uniform(self.tool_lower, self.tool_upper), turn) @ Pose.from_xyz_rpy(
                np.zeros(3), (math.pi, 0.0, 0.0)
            )
            start = self._posture(tool, rng)
            if start is not None:
                return start, goal

    def demonstrate(self, rng: np.random.Generator) -> Demonstration:
        """Return one episode: from a start, from near the object, or with the object already in the hand.

        The episode ends at a joint limit. Raises PolicyError if it starts at one.
        """
        state, goal = self._begin(rng)
        observations: list[Observation] = []
        chunks: list[Array] = []
        lifted = False
        while len(chunks) < self.chunks and not lifted:
            lifted = self.lifted(state, goal)
            try:
                steps, gripper = self._ahead(state, goal)
            except PolicyError:
                if not chunks:
                    raise
                break
            observations.append(self.observation(state, goal, rng))
            deltas = np.diff([step.positions for step in steps], axis=0)
            chunks.append(np.column_stack([deltas, gripper]))
            state = self._pushed(steps[self.executed], rng)
        return Demonstration(tuple(observations), np.array(chunks))

    def plan(self, state: PickState, goal: Pose) -> tuple[Array, Array]:
        """Return the next H joint deltas (H, n) and gripper commands (H,). Raises PolicyError at a limit of the arm."""
        steps, gripper = self._ahead(state, goal)
        return np.diff([step.positions for step in steps], axis=0), np.array(gripper)

    def lifted(self, state: PickState, goal: Pose) -> bool:
        """Return whether the object is in the hand and at its target height, within a centimetre."""
        height = float(self.kinematics.tool_pose(state.positions).position[2] - goal.position[2])
        return self._grips(state.width) and height > self.picked.rise + self.lift - 0.01

    def observation(self, state: PickState, goal: Pose, rng: np.random.Generator | None = None) -> Observation:
        """Return the observation; with ``rng`` the gripper's width has encoder noise of half a millimetre."""
        noise = 0.0 if rng is None else float(rng.normal(0.0, 0.0005))
        return Observation(
            state.positions,
            self.kinematics.tool_pose(state.positions),
            pose_vector(goal),
            state.width + noise,
            joint_velocities=state.velocities,
        )

    def step(self, state: PickState, goal: Pose) -> tuple[PickState, float]:
        """Return the state ``dt`` seconds later, and the gripper command: OPEN or CLOSED."""
        target, gripper = self._intent(state, goal)
        tool = self.kinematics.tool_pose(state.positions)
        for share in (1.0, 0.5, 0.2):
            nearer = _towards(tool, target, share * self.carrot)
            positions = self.kinematics.track(nearer, state.positions)
            if positions is not None:
                return self._moved(state, np.clip(positions, self.arm.lower, self.arm.upper), gripper), gripper
        raise PolicyError("the expert cannot continue: its arm has reached a limit")

    def _grips(self, width: float) -> bool:
        return abs(width - self.picked.width) < 0.002

    def _intent(self, state: PickState, goal: Pose) -> tuple[Pose, float]:
        """Return the next pose of the tool and the command of the gripper."""
        thing = self.picked
        tool = self.kinematics.tool_pose(state.positions)
        grasp = self._grasp(goal)
        if self._grips(state.width):
            return _above(grasp, self.lift), CLOSED
        if state.width < 0.5 * (thing.width + thing.opening):
            return grasp, CLOSED
        error = pose_error(grasp, tool)
        aside = float(np.linalg.norm(error[:2])) + _LEVER * float(np.linalg.norm(error[3:]))
        u = min(max((aside - self.aligned) / (self.astray - self.aligned), 0.0), 1.0)
        above = self.hover * u * u * (3.0 - 2.0 * u)
        there = float(np.linalg.norm(error[:3])) < self.at_grasp and float(np.abs(state.velocities).max()) < self.slow
        closing = there or state.width < thing.opening - 0.002
        return _above(grasp, above), CLOSED if closing else OPEN

    def _grasp(self, goal: Pose) -> Pose:
        """Return a grasp from above, turned in the arm's direction, where its last joint has most room."""
        x, y, z = goal.position
        shoulder = self.kinematics.reach[0]
        yaw = math.atan2(y - shoulder[1], x - shoulder[0])
        return Pose.from_xyz_rpy((x, y, z + self.picked.rise), (math.pi, 0.0, yaw))

    def _ahead(self, state: PickState, goal: Pose) -> tuple[list[PickState], list[float]]:
        states, commands = [state], []
        for _ in range(self.horizon):
            state, gripper = self.step(state, goal)
            states.append(state)
            commands.append(gripper)
        return states, commands

    def _moved(self, state: PickState, target: Array, gripper: float) -> PickState:
        velocity, acceleration, jerk = self._limits
        if np.abs(np.concatenate([target - state.positions, state.velocities, state.accelerations])).max() < _STILL:
            rest = np.zeros(len(target))
            return PickState(state.positions, rest, rest, self._width_after(state.width, gripper))
        request, result = ruckig.InputParameter(len(target)), ruckig.OutputParameter(len(target))
        request.current_position, request.target_position = state.positions.tolist(), target.tolist()
        request.current_velocity = np.clip(state.velocities, -velocity, velocity).tolist()
        request.current_acceleration = np.clip(state.accelerations, -acceleration, acceleration).tolist()
        request.max_velocity, request.max_acceleration = velocity.tolist(), acceleration.tolist()
        request.max_jerk = jerk.tolist()
        if self._ruckig.update(request, result) not in (ruckig.Result.Working, ruckig.Result.Finished):
            raise PolicyError(f"ruckig found no motion from {state.positions} to {target}")
        return PickState(
            np.array(result.new_position),
            np.array(result.new_velocity),
            np.array(result.new_acceleration),
            self._width_after(state.width, gripper),
        )

    def _width_after(self, width: float, gripper: float) -> float:
        way = self.closing_speed * self.dt
        return min(width + way, self.picked.opening) if gripper > 0.0 else max(width - way, self.picked.width)

    def _begin(self, rng: np.random.Generator) -> tuple[PickState, Pose]:
        start, goal = self.task(rng)
        kind, thing, rest = rng.uniform(), self.picked, np.zeros(len(start))
        if kind < 0.5:
            return PickState(start, rest, rest, thing.opening), goal
        grasp = self._grasp(goal)
        held = kind > 0.8
        aside = rng.uniform(-1.0, 1.0, 2) * (0.005 if held else 0.03 * rng.uniform())
        up = rng.uniform(0.0, self.lift if held else self.hover)
        turn = rng.uniform(-1.0, 1.0, 3) * 0.1 * rng.uniform()
        near = Pose(grasp.position + np.append(aside, up)) @ Pose.from_xyz_rpy(np.zeros(3), turn)
        positions = self._posture(near @ Pose(np.zeros(3), grasp.quaternion), rng)
        width = thing.width if held else thing.opening
        return PickState(start if positions is None else positions, rest, rest, width), goal

    def _pushed(self, state: PickState, rng: np.random.Generator) -> PickState:
        """Return a little off, most often very little."""
        push = self.drift * rng.uniform() ** 2
        positions = state.positions + rng.normal(0.0, push, len(state.positions))
        velocities = state.velocities + rng.normal(0.0, 2.0 * push, len(positions))
        positions = np.clip(positions, self.arm.lower + 0.03, self.arm.upper - 0.03)
        return PickState(positions, velocities, state.accelerations, state.width)

    def _posture(self, tool: Pose, rng: np.random.Generator) -> Array | None:
        reference = self.home + rng.normal(0.0, self.posture_noise, len(self.home))
        found = self.kinematics.solve(tool, np.clip(reference, self.arm.lower, self.arm.upper), rng, attempts=1)
        return found.best if found.found else None


def _above(pose: Pose, height: float) -> Pose:
    return Pose(pose.position + np.array([0.0, 0.0, height]), pose.quaternion)


def _towards(tool: Pose, target: Pose, carrot: float) -> Pose:
    """Return the pose on the straight way from ``tool`` to ``target``, at most ``carrot`` metres ahead."""
    error = pose_error(target, tool)
    distance = float(np.linalg.norm(error[:3])) + 0.2 * float(np.linalg.norm(error[3:]))
    share = min(1.0, carrot / max(distance, 1e-9))
    angle = float(np.linalg.norm(error[3:]))
    half = 0.5 * share * angle
    axis = error[3:] / angle if angle > 1e-9 else np.array([0.0, 0.0, 1.0])
    turn = Pose(np.zeros(3), np.append(np.sin(half) * axis, np.cos(half)))
    return Pose(tool.position + share * error[:3], (turn @ Pose(np.zeros(3), tool.quaternion)).quaternion)


class ExpertPolicy(Policy):
    """Plans its actions from the observations that a learned policy gets."""

    def __init__(self, expert: PickingExpert, robot: str) -> None:
        self._expert, self._specification = expert, expert.specification(robot)

    @property
    def specification(self) -> PolicySpecification:
        """The specification of the policy to be trained."""
        return self._specification

    def reset(self) -> None:
        """Do nothing: the policy is stateless."""

    def act(self, observation: Observation) -> ActionChunk:
        """Return a planned chunk. Raises PolicyObservationError without velocities, gripper width or a pose as goal."""
        velocities, width, goal = observation.joint_velocities, observation.gripper_width, observation.goal
        if velocities is None or width is None or goal.shape != (7,):
            raise PolicyObservationError("the expert needs velocities, the gripper's width and a pose as goal")
        state = PickState(observation.joint_positions, velocities, np.zeros(len(velocities)), width)
        deltas, gripper = self._expert.plan(state, Pose(goal[:3], goal[3:]))
        widths = np.where(gripper > 0.0, self._specification.open_width, 0.0)
        return ActionChunk(deltas, self._specification.dt, ActionSpace.JOINT_DELTAS, widths)
