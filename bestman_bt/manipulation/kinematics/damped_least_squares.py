"""Inverse kinematics by damped least squares with restarts.

Nakamura and Hanafusa, "Inverse kinematic solutions with singularity robustness", 1986; the damping fades with the
error, as in Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method", T-RO 2011, so
that poses near a singularity converge; the error is the logarithm of the pose error, as in pinocchio's example.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated

import numpy as np
import pinocchio
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.lapack import dposv
from typing_extensions import override

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.joint_values import joint_vector
from bestman_bt.manipulation.kinematics.base import IKResult, InverseKinematics
from bestman_bt.manipulation.kinematics.pinocchio_model import (
    arm_order,
    build_model,
    configuration,
    frame_index,
    joints_to_lock,
    to_pose,
    to_se3,
)
from bestman_bt.messages import Pose
from bestman_bt.messages.shapes import Count
from bestman_bt.robot_model.model import ArmModel, RobotModel


@dataclass(frozen=True, eq=False)
class DampedLeastSquares(InverseKinematics):
    """Damped least squares: q ← clip(q + Jᵀ (J Jᵀ + λI)⁻¹ e) from several start positions.

    ``fixed``: positions of joints outside the arm (such as a torso); missing ones are at zero. ``tolerance``: m and
    rad, of every component of the error. ``damping``: added to J Jᵀ, proportional to the error below ``fade``, m and
    rad. ``max_step``: rad per joint. ``max_iterations``: of one attempt. ``limit_margin``: rad from the joint limits.
    ``attempts``: number of start positions: the reference, then ``near_attempts`` within ``near_std`` rad of it, then
    random ones. ``distinct``: rad by which two solutions differ in at least one joint. ``track_step``: rad, largest
    joint motion in one ``track``; a descent that moves further than ``track_leash`` is given up. ``patience``:
    iterations without improvement after which an attempt ends; ``track_patience``: the same for ``track``.
    """

    robot: RobotModel
    arm: str = "arm"
    fixed: Mapping[str, float] = field(default_factory=dict)
    tolerance: Annotated[float, "m, rad"] = 2e-5
    damping: float = 1e-4
    fade: Annotated[float, "m, rad"] = 0.05
    max_step: Annotated[float, "rad"] = 0.4
    max_iterations: Count = 100
    patience: int = 20
    limit_margin: Annotated[float, "rad"] = 0.02
    attempts: Count = 60
    near_attempts: int = 6
    near_std: Annotated[float, "rad"] = 0.6
    distinct: Annotated[float, "rad"] = 0.2
    track_step: Annotated[float, "rad"] = 0.3
    track_leash: Annotated[float, "rad"] = 0.45
    track_patience: int = 6

    def __post_init__(self) -> None:
        if self.arm not in self.robot.of(ArmModel):
            raise ManipulationError(
                f"robot {self.robot.name!r} has no arm {self.arm!r}; "
                f"it has {', '.join(self.robot.of(ArmModel)) or 'none'}"
            )

    @cached_property
    def arm_model(self) -> ArmModel:
        """The arm: its joints with their limits, and its tool."""
        return self.robot.of(ArmModel)[self.arm]

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the arm's joints."""
        return self.arm_model.joint_names

    @property
    def fingerprint(self) -> str:
        """The URDF, the frames of base and tool, the joints with their limits, and the fixed ones."""
        robot, arm = self.robot, self.arm_model
        limits = arm.lower.tolist(), arm.upper.tolist()
        fixed = sorted(self.fixed.items())
        return repr((robot.urdf, robot.base_frame, arm.joint_names, arm.tool_frame, *limits, fixed))

    @cached_property
    def _model(self) -> pinocchio.Model:
        full = build_model(self.robot)
        return pinocchio.buildReducedModel(full, joints_to_lock(full, self.arm_model), configuration(full, self.fixed))

    @cached_property
    def _data(self) -> pinocchio.Data:
        return self._model.createData()

    @cached_property
    def _order(self) -> NDArray[np.intp] | None:
        return arm_order(self._model, self.arm_model)

    @cached_property
    def _tool(self) -> int:
        return frame_index(self._model, self.arm_model.tool_frame)

    @cached_property
    def _root_from_base(self) -> pinocchio.SE3:
        model, data = self._model, self._data
        pinocchio.forwardKinematics(model, data, pinocchio.neutral(model))
        return pinocchio.updateFramePlacement(model, data, frame_index(model, self.robot.base_frame)).copy()

    @cached_property
    def _bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        margin = np.minimum(self.limit_margin, (self.arm_model.upper - self.arm_model.lower) / 4)
        return self.arm_model.lower + margin, self.arm_model.upper - margin

    def tool_pose(self, positions: ArrayLike) -> Pose:
        """Return base_from_tool at ``positions`` (n,), radians."""
        return to_pose(self._root_from_base.actInv(self._place(self._checked(positions, "positions"))))

    @override
    def tool_direction(self, positions: NDArray[np.float64], axis: NDArray[np.float64]) -> NDArray[np.float64]:
        placement = self._place(positions)
        direction: NDArray[np.float64] = self._root_from_base.rotation.T @ (placement.rotation @ axis)
        return direction

    @override
    def jacobian(self, positions: ArrayLike) -> NDArray[np.float64]:
        q = self._to_model(self._checked(positions, "positions"))
        columns: NDArray[np.float64] = pinocchio.computeFrameJacobian(
            self._model, self._data, q, self._tool, pinocchio.LOCAL
        )
        return columns if self._order is None else columns[:, np.argsort(self._order)]

    def manipulability(self, positions: ArrayLike) -> float:
        """Return Yoshikawa's manipulability sqrt(det(J Jᵀ)) of the tool's Jacobian; 0 at a singularity."""
        jacobian = self.jacobian(positions)
        return float(np.sqrt(max(0.0, np.linalg.det(jacobian @ jacobian.T))))

    def _start(self, attempt: int, origin: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        if attempt == 0:
            return origin
        if attempt <= self.near_attempts:
            return origin + rng.normal(0.0, self.near_std, len(origin))
        return rng.uniform(*self._bounds)

    def solve(
        self,
        base_from_tool: Pose,
        reference: ArrayLike,
        rng: np.random.Generator,
        count: int = 1,
        is_valid: Callable[[NDArray[np.float64]], bool] | None = None,
        attempts: int | None = None,
    ) -> IKResult:
        """Search up to ``count`` distinct solutions; see the base class."""
        target = self._target(base_from_tool)
        origin = self._checked(reference, "reference")
        lower, upper = self._bounds
        solutions: list[NDArray[np.float64]] = []
        closest, rejected, tried = (np.inf, np.inf), 0, 0
        if not self._in_reach(target):
            return IKResult((), *self._errors(target, origin), 0)
        for attempt in range(attempts or self.attempts):
            tried = attempt + 1
            start = self._start(attempt, origin, rng)
            q, reached = self._descend(target, np.clip(start, lower, upper), lower, upper)
            if not reached:
                if not solutions:
                    closest = min(closest, self._errors(target, q), key=sum)
                continue
            if any(np.abs(q - other).max() < self.distinct for other in solutions):
                continue
            if is_valid is not None and not is_valid(q):
                rejected += 1
                continue
            solutions.append(q)
            if len(solutions) >= count:
                break
        solutions.sort(key=lambda q: float(np.linalg.norm(q - origin)))
        if solutions:
            closest = self._errors(target, solutions[0])
        return IKResult(tuple(solutions), *closest, tried, rejected)

    @override
    def track(self, base_from_tool: Pose, start: ArrayLike) -> NDArray[np.float64] | None:
        origin = self._checked(start, "start")
        lower, upper = self._bounds
        # A start inside the margin must not jump out of it.
        q, reached = self._descend(
            self._target(base_from_tool),
            origin,
            np.minimum(lower, origin),
            np.maximum(upper, origin),
            self.track_patience,
            self.track_leash,
        )
        return q if reached and np.abs(q - origin).max() <= self.track_step else None

    def _descend(
        self,
        target: pinocchio.SE3,
        start: NDArray[np.float64],
        lower: NDArray[np.float64],
        upper: NDArray[np.float64],
        patience: int | None = None,
        leash: float = math.inf,
    ) -> tuple[NDArray[np.float64], bool]:
        """Descend; most planning time is spent here, hence LAPACK and lists, since numpy's own calls cost several times
        that.
        """
        model, data, tool = self._model, self._data, self._tool
        patience = self.patience if patience is None else patience
        to_arm = None if self._order is None else np.argsort(self._order)
        q, best, since_best = start, math.inf, 0
        for _ in range(self.max_iterations):
            in_model = self._to_model(q)
            pinocchio.forwardKinematics(model, data, in_model)
            tool_from_target = pinocchio.updateFramePlacement(model, data, tool).actInv(target)
            error = pinocchio.log6(tool_from_target).vector
            size = _largest(error)
            if size < self.tolerance:
                return q, True
            if size < best:
                best, since_best = size, 0
            else:
                since_best += 1
                if since_best > patience:
                    break
            jacobian = pinocchio.computeFrameJacobian(model, data, in_model, tool, pinocchio.LOCAL)
            jacobian = pinocchio.Jlog6(tool_from_target.inverse()) @ jacobian
            damped = jacobian @ jacobian.T
            damped.ravel()[::7] += self.damping * min(1.0, size / self.fade)
            step = jacobian.T @ dposv(damped, error)[1]
            if to_arm is not None:
                step = step[to_arm]
            step *= min(1.0, self.max_step / max(_largest(step), 1e-12))
            q = np.minimum(np.maximum(q + step, lower), upper)
            if leash < math.inf and _largest(q - start) > leash:
                break
        return q, False

    @property
    def reach(self) -> tuple[NDArray[np.float64], float]:
        """Return the shoulder (3,) in the base frame and the largest distance of the tool from it, metres."""
        shoulder, length = self._reach
        return self._root_from_base.actInv(shoulder), length

    def _in_reach(self, target: pinocchio.SE3) -> bool:
        shoulder, length = self._reach
        return bool(np.linalg.norm(target.translation - shoulder) <= length)

    @cached_property
    def _reach(self) -> tuple[NDArray[np.float64], float]:
        """``reach``, with the shoulder in the root frame: the first joint, and the lengths from there to the tool."""
        model, data = self._model, self._data
        pinocchio.forwardKinematics(model, data, pinocchio.neutral(model))
        chain = [model.frames[self._tool].parentJoint]
        while model.parents[chain[-1]] != 0:
            chain.append(model.parents[chain[-1]])
        lengths = [float(np.linalg.norm(model.jointPlacements[joint].translation)) for joint in chain[:-1]]
        travel = self.arm_model.upper - self.arm_model.lower
        sliding = sum(
            float(travel[i])
            for i, name in enumerate(self.arm_model.joint_names)
            if model.joints[model.getJointId(name)].shortname().startswith("JointModelP")
        )
        tip = float(np.linalg.norm(model.frames[self._tool].placement.translation))
        return data.oMi[chain[-1]].translation.copy(), sum(lengths) + tip + sliding + 1e-6

    def _errors(self, target: pinocchio.SE3, positions: NDArray[np.float64]) -> tuple[float, float]:
        placement = self._place(positions)
        rotation = pinocchio.log3(placement.rotation.T @ target.rotation)
        return float(np.linalg.norm(placement.translation - target.translation)), float(np.linalg.norm(rotation))

    def _place(self, positions: NDArray[np.float64]) -> pinocchio.SE3:
        pinocchio.forwardKinematics(self._model, self._data, self._to_model(positions))
        return pinocchio.updateFramePlacement(self._model, self._data, self._tool)

    def _to_model(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        return positions if self._order is None else positions[self._order]

    def _target(self, base_from_tool: Pose) -> pinocchio.SE3:
        if not (np.isfinite(base_from_tool.position).all() and np.isfinite(base_from_tool.quaternion).all()):
            raise ManipulationError(f"base_from_tool should be finite but is {base_from_tool}")
        return self._root_from_base * to_se3(base_from_tool)

    def _checked(self, values: ArrayLike, what: str) -> NDArray[np.float64]:
        return joint_vector(values, len(self.arm_model.joint_names), f"{what} of arm joints")


def _largest(values: NDArray[np.float64]) -> float:
    """Return the largest magnitude."""
    return float(max(map(abs, values.tolist())))
