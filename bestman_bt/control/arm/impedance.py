"""Impedance: the tool gives way like a spring and damper that tie it to a pose.

N. Hogan, "Impedance control", 1985; damping by the inertia that the tool has at each posture: A. Albu-Schäffer et al.,
"Cartesian impedance control of redundant robots", 2003; null space: O. Khatib, "Operational space formulation", 1987.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import sqrtm
from scipy.spatial.transform import Rotation

from bestman_bt.manipulation.kinematics import ArmDynamics, InverseKinematics
from bestman_bt.messages import Failure, MotionErrorCode, Pose
from hal.api import Arm, Clock, CommandRefusedError, Motion, MotionStatus, NotConnectedError, Timer

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ImpedanceParameters:
    """``stiffness``: N/m, ``turn_stiffness``: N m/rad of the tool; ``damping_ratio``: 1 is critical.

    ``posture_stiffness``, ``posture_damping``: N m/rad and N m s/rad with which what the tool leaves free keeps its
    posture. ``reach``: metres that the target may be from the tool; beyond, the spring pulls no harder.
    ``speed_share``: of the joints' speed limits, above which it is given up. ``period``: seconds between two torques.
    """

    stiffness: float = 400.0
    turn_stiffness: float = 30.0
    damping_ratio: float = 0.8
    posture_stiffness: float = 8.0
    posture_damping: float = 2.0
    reach: float = 0.10
    speed_share: float = 1.0
    period: float = 1.0 / 240.0

    def __post_init__(self) -> None:
        for name in ("stiffness", "turn_stiffness", "damping_ratio", "reach", "speed_share", "period"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"ImpedanceParameters {name} should be above 0, got {getattr(self, name)}")


class ImpedanceController:
    """Commands joint torques: for arms that take them. What the arm carries beyond its URDF pulls the tool down."""

    def __init__(
        self,
        arm: Arm,
        clock: Clock,
        kinematics: InverseKinematics,
        dynamics: ArmDynamics,
        parameters: ImpedanceParameters | None = None,
    ) -> None:
        self._arm, self._clock, self._kinematics, self._dynamics = arm, clock, kinematics, dynamics
        self._parameters = parameters or ImpedanceParameters()
        self._most = arm.model.effort
        self._fastest = self._parameters.speed_share * arm.model.velocity
        self._target = Pose()
        self._posture: Array = np.zeros(len(self._most))
        self._timer: Timer | None = None
        self._motion: Motion[None] | None = None

    @property
    def target(self) -> Pose:
        """base_from_tool that the spring pulls to."""
        return self._target

    def hold(self, base_from_tool: Pose | None = None) -> Motion[None]:
        """Tie the tool to a pose (where it is, by default) until the motion is cancelled or something else commands.

        It goes on as RUNNING; ``move_target`` pulls it elsewhere. It fails as TRACKING where a joint gets too fast, and
        ends as STOPPED with the robot.
        """
        self._end(Failure(MotionErrorCode.SUPERSEDED, "a newer command took over"))
        self._posture = self._arm.positions()
        self._target = base_from_tool or self._kinematics.tool_pose(self._posture)
        self._motion = Motion(self._arm.name, self._release)
        self._timer = self._clock.every(self._parameters.period, self._tick)
        self._tick()
        return self._motion

    def move_target(self, base_from_tool: Pose) -> None:
        """Tie the tool to another pose from now on."""
        self._target = base_from_tool

    def _tick(self) -> None:
        motion = self._motion
        if motion is None or motion.done:
            return
        try:
            speeds = self._arm.velocities()
            if np.any(np.abs(speeds) > self._fastest):
                worst = self._arm.joint_names[int(np.argmax(np.abs(speeds) / self._fastest))]
                motion.fail(MotionErrorCode.TRACKING, f"{worst} turns faster than it may while the arm gives way")
                self._release()
                return
            self._arm.command(efforts=self._torques(self._arm.positions(), speeds))
        except (CommandRefusedError, NotConnectedError) as error:
            self._end(replace(error.failure, code=MotionErrorCode.STOPPED))

    def _torques(self, positions: Array, speeds: Array) -> Array:
        p = self._parameters
        jacobian, mass = self._kinematics.jacobian(positions), self._dynamics.mass_matrix(positions)
        mobility = np.linalg.solve(mass, jacobian.T)
        inertia: Array = np.asarray(np.linalg.inv(jacobian @ mobility + 1e-6 * np.eye(6)), float)
        stiffness: Array = np.diag(np.repeat([p.stiffness, p.turn_stiffness], 3))
        pull = stiffness @ self._error(positions) - self._damping(inertia, stiffness) @ (jacobian @ speeds)
        posture = p.posture_stiffness * (self._posture - positions) - p.posture_damping * speeds
        free = posture - jacobian.T @ (inertia @ (mobility.T @ posture))
        torques = jacobian.T @ pull + free + self._dynamics.gravity(positions)
        return np.clip(torques, -self._most, self._most)

    def _error(self, positions: Array) -> Array:
        """From the tool to the target, (6,) metres and radians in the tool frame."""
        off = self._kinematics.tool_pose(positions).inverse() @ self._target
        way = off.position * min(1.0, self._parameters.reach / max(float(np.linalg.norm(off.position)), 1e-9))
        return np.concatenate([way, Rotation.from_quat(off.quaternion).as_rotvec()])

    def _damping(self, inertia: Array, stiffness: Array) -> Array:
        """The matrix (6, 6) that damps each natural motion of inertia and spring by the same ratio."""
        root = np.real(sqrtm(inertia))
        inverse = np.linalg.inv(root)
        return np.asarray(
            2.0 * self._parameters.damping_ratio * root @ np.real(sqrtm(inverse @ stiffness @ inverse)) @ root
        )

    def _release(self) -> None:
        """The arm holds where it is."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._arm.stop()

    def _end(self, failure: Failure) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._motion is not None:
            self._motion.end(MotionStatus.CANCELED, failure)
