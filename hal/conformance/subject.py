"""The robot under test: its parts by kind, helpers to move it and wait for it, and the error of a failed check."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import wraps
from typing import TypeVar
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from bestman_bt.errors import Error
from bestman_bt.robot_model.model import ArmModel, BaseModel, GripperModel, JointGroupModel, RobotModel
from bestman_bt.robot_model.sensor_parts import (
    BatteryPart,
    CameraPart,
    ImuPart,
    LidarPart,
    MountedBumper,
    MountedForceTorque,
    TactilePart,
)
from bestman_bt.robot_model.urdf_tree import joints_above
from hal.api import (
    Arm,
    Battery,
    Bumper,
    Camera,
    Clock,
    ForceTorque,
    Gripper,
    Imu,
    JointGroup,
    Lidar,
    MobileBase,
    Motion,
    Part,
    Robot,
    RobotError,
    Tactile,
)

PartType = TypeVar("PartType", bound=Part)
POLL = 0.05
AGAIN = 0.05
"""Seconds after which a velocity of joints is commanded again."""
IDLE = 0.02
"""Wall time, seconds, in which a real-time clock advances and a simulated one does not."""
REST_TIME = 0.5
"""Seconds in which a robot must come to rest, and for which it must then stay at rest."""
LAG = 0.5
"""Seconds by which readings of a robot in another process may lag on a busy machine."""
REST_JOINT_SPEED = 0.01
REST_BASE_SPEED = 0.01
COMMANDS = "commands"
"""The feature that a robot declares unsupported if it accepts no commands, such as one that plays a recording."""
MODEL_KINDS: Mapping[type[Part], tuple[type, ...]] = {
    Arm: (ArmModel,),
    JointGroup: (ArmModel, JointGroupModel),
    Gripper: (GripperModel,),
    MobileBase: (BaseModel,),
    Camera: (CameraPart,),
    Lidar: (LidarPart,),
    ForceTorque: (MountedForceTorque,),
    Imu: (ImuPart,),
    Tactile: (TactilePart,),
    Bumper: (MountedBumper,),
    Battery: (BatteryPart,),
}
"""Kind of part → its descriptions in the robot model."""


@dataclass(frozen=True)
class Check:
    """One requirement on an implementation.

    ``needs``: kinds of parts that the check requires. ``commands``: whether it commands motions.
    """

    run: Callable[[Robot], None]
    needs: tuple[type[Part], ...] = ()
    commands: bool = False

    @property
    def name(self) -> str:
        """The name of the function, with spaces."""
        return self.run.__name__.replace("_", " ")

    def why_not(self, robot: Robot) -> str | None:
        """Return why the check does not apply to a robot, according to its declarations; None: it applies."""
        declared = robot.unsupported
        if self.name in declared:
            return declared[self.name]
        if self.commands and COMMANDS in declared:
            return declared[COMMANDS]
        for kind in self.needs:
            if not parts_of(robot, kind):
                reasons = [declared[name] for name in modelled(robot, kind) if name in declared]
                return "; ".join(dict.fromkeys(reasons)) or f"the robot has no {kind.kind}"
        return None


def modelled(robot: Robot, kind: type[Part]) -> Iterator[str]:
    """Yield the names of the model's parts of a kind."""
    descriptions = MODEL_KINDS.get(kind, ())
    yield from (name for name, part in robot.model.parts.items() if isinstance(part, descriptions))


def parts_of(robot: Robot, kind: type[PartType]) -> list[PartType]:
    """Return the robot's parts of a kind."""
    return [part for part in robot.parts.values() if isinstance(part, kind)]


def first(robot: Robot, kind: type[PartType]) -> PartType:
    """Return the first part of a kind."""
    return parts_of(robot, kind)[0]


def each(kind: type[PartType]) -> Callable[[Callable[[Robot, PartType], None]], Callable[[Robot], None]]:
    """Return a decorator that runs a check on each of the robot's parts of ``kind``."""

    def of_all(check: Callable[[Robot, PartType], None]) -> Callable[[Robot], None]:
        @wraps(check)
        def run(robot: Robot) -> None:
            for part in parts_of(robot, kind):
                check(robot, part)

        return run

    return of_all


def waits_for_sleeps(clock: Clock) -> bool:
    """Return whether time passes only in sleeps, as in simulation, or by itself.

    Wall time passes during each query, so that a clock that compensates for a long sleep has finished doing so.
    """
    before = clock.now()
    time.sleep(IDLE)
    return clock.now() <= before


def finish(robot: Robot, motion: Motion[None], limit: float = 20.0) -> None:
    """Wait for a motion; it has to end within ``limit`` seconds."""
    deadline = robot.clock.now() + limit
    while not motion.done:
        require(robot.clock.now() < deadline, f"a motion was still running after {limit} s")
        robot.clock.sleep(POLL)


def nearby(robot: Robot, group: JointGroup, step: float = 0.3) -> NDArray[np.float64]:
    """Return positions (n,) between half of ``step`` and ``step`` from the current ones: away from the posture
    ``home``, or back.

    Away from ``home`` each joint moves to the side with more range, so that checks in any order and number stay near a
    posture without contact.
    """
    present = group.positions()
    lower = group.model.lower
    upper = group.model.upper
    middle = (lower + upper) / 2
    posture = robot.model.postures.get("home", {})
    home = np.array([posture.get(joint, at) for joint, at in zip(group.joint_names, middle, strict=True)])
    away = np.clip(home + np.where(home <= middle, step, -step), lower, upper)
    goal = np.where(np.abs(present - home) < step / 2, away, home)
    return np.asarray(present + np.clip(goal - present, -step, step))


def set_moving(robot: Robot) -> list[Motion[None]]:
    """Command all parts to move and wait until they do."""
    motions: list[Motion[None]] = [group.move_to(nearby(robot, group), 0.5) for group in parts_of(robot, JointGroup)]
    for gripper in parts_of(robot, Gripper):
        closed, opened = gripper.model.part.min_width, gripper.model.max_width
        motions.append(gripper.move(opened if gripper.width() < (closed + opened) / 2 else closed))
    motions.extend(base.rotate(1.0) for base in parts_of(robot, MobileBase))
    robot.clock.sleep(0.2)
    return motions


def keep_velocity(robot: Robot, group: JointGroup, velocities: NDArray[np.float64], duration: float) -> None:
    """Command ``velocities`` (n,), m/s or rad/s, repeated before they expire, for ``duration`` seconds."""
    end = robot.clock.now() + duration
    while (left := end - robot.clock.now()) > 1e-6:
        group.command(velocities=velocities)
        robot.clock.sleep(min(left, AGAIN))


def moving_parts(robot: Robot) -> list[str]:
    """Return the moving arms, groups and bases with their velocities; rest is as the API defines it."""
    moving = []
    for group in parts_of(robot, JointGroup):
        velocities = group.velocities()
        if np.any(np.abs(velocities) > REST_JOINT_SPEED):
            moving.append(f"{group.name} at {velocities.round(4)}")
    for base in parts_of(robot, MobileBase):
        velocity = base.velocity()
        if max(abs(velocity.vx), abs(velocity.vy), abs(velocity.wz)) > REST_BASE_SPEED:
            moving.append(f"{base.name} at {velocity}")
    return moving


def require_rest(robot: Robot, after: str) -> None:
    """Require that the robot is at rest, including its fingers, and stays so."""
    robot.clock.sleep(REST_TIME)
    moving, last = moving_parts(robot), robot.clock.now() + LAG
    while moving and robot.clock.now() < last:
        robot.clock.sleep(POLL)
        moving = moving_parts(robot)
    require(not moving, f"the robot should be at rest {REST_TIME} s after {after}, yet: {', '.join(moving)}")
    groups, grippers = parts_of(robot, JointGroup), parts_of(robot, Gripper)
    bases = parts_of(robot, MobileBase)
    places, widths = [group.positions() for group in groups], [gripper.width() for gripper in grippers]
    stood = [base.odometry() for base in bases]
    robot.clock.sleep(REST_TIME)
    for group, place in zip(groups, places, strict=True):
        moved = float(np.max(np.abs(group.positions() - place)))
        require(moved < 0.01, f"{group.name} moved by {moved:.4f} while at rest after {after}")
    for gripper, width in zip(grippers, widths, strict=True):
        moved = abs(gripper.width() - width)
        require(moved < 0.003, f"{gripper.name} moved by {moved:.4f} m while at rest after {after}")
    for base, before in zip(bases, stood, strict=True):
        way = before.inverse() @ base.odometry()
        still = max(abs(way.x), abs(way.y), abs(way.theta)) < 0.01
        require(still, f"{base.name} moved by {way} while at rest after {after}")


def mass_on(model: RobotModel, joints: tuple[str, ...]) -> float:
    """Return the mass of all links carried by one of these joints, kg."""
    masses = {
        str(link.get("name")): float(mass.get("value", 0.0))
        for link in ElementTree.fromstring(model.urdf).iter("link")
        for mass in link.iterfind("inertial/mass")
    }
    return sum(mass for link, mass in masses.items() if joints_above(model, link) & set(joints))


def settle(robot: Robot) -> None:
    """Clear a stop and wait until all parts are at rest; for use between two checks."""
    robot.stop()
    robot.clock.sleep(2 * REST_TIME)
    robot.clear_stop()


ARMS = (Arm,)
GROUPS = (JointGroup,)
GRIPPERS = (Gripper,)
BASES = (MobileBase,)


class ConformanceError(Error, AssertionError):
    """Raised if an implementation violates a requirement of the Robotics API."""


def require(holds: bool, sentence: str) -> None:
    """Raise ConformanceError with ``sentence`` unless ``holds``."""
    if not holds:
        raise ConformanceError(sentence)


def require_refusal(
    call: Callable[[], object], error: type[RobotError], what: str, words: tuple[str, ...] = ()
) -> None:
    """Require that ``call`` raises ``error`` with all ``words`` in its message."""
    try:
        call()
    except error as refusal:
        missing = [word for word in words if word not in str(refusal)]
        require(not missing, f"the message about {what} lacks {missing}: {refusal}")
        return
    raise ConformanceError(f"{what} should raise {error.__name__}")
