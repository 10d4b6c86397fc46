"""One fault of a twin while a tree runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from behaviours.clear_stop import ClearStop
from behaviours.manipulation.move_arm import MoveArm
from behaviours.navigation.navigate import NavigateTo
from behaviours.perception.look import LookAt
from behaviours.perception.perceive import DetectObject
from benchmarks.fault_trials.hand import MoveFingers
from benchmarks.fault_trials.left_behind import LeftBehind
from benchmarks.fault_trials.truth import place
from bestman_bt.engine import Fallback, Node, Sequence, Sleep
from bestman_bt.messages import Pose2D
from bestman_bt.runtime.resolved_config import ResolvedConfig
from bestman_bt.runtime.robot_session import RobotSession, open_session
from hal.hardware.isolated_robot import IsolatedRobot
from hal.twins.process import TwinProcess

MOVING, RESTING = 0.01, 0.002
"""Radians or metres between two looks at the world."""
GRACE = 3.0
"""Seconds that threads and processes get to end."""


class Act(StrEnum):
    """What the robot does when the fault strikes."""

    ARM = "arm"
    HAND = "hand"
    BASE = "base"
    LOOK = "look"


@dataclass(frozen=True)
class Trial:
    """``undo``: taken back once the robot rests, as by an operator. ``codes``: what the leaf may fail with.

    ``allowed``: seconds from the fault to the command to stop: until it can be detected, and 0.1 s. ``rests_in``:
    seconds after which the robot stands. ``stops``: whether the whole robot is stopped, which the recovery clears.
    """

    name: str
    robot: str
    act: Act
    connection: str
    fault: str
    codes: tuple[str, ...]
    allowed: float
    value: float | None = None
    undo: str = "restore"
    rests_in: float = 1.0
    stops: bool = True


@dataclass(frozen=True)
class Report:
    """How a trial went; times in seconds after the fault. ``stopped``: None where the robot is to go on.

    ``orphans``: threads and processes that were left behind.
    """

    stopped: float | None
    failed: float
    code: str
    words: str
    at_rest: bool
    recovered: bool
    orphans: tuple[str, ...] = ()


XARM, UR = "diff_xarm6", "diff_ur5_robotiq"
ARM, HAND, PLATFORM = "arm_controller", "hand_controller", "platform"
AT_ONCE, WATCHDOG = 0.1, 0.3
STALE = 0.25 + 0.05 + 0.1
"""Odometry counts as stale 50 ms after the watchdog's time."""
LATE = 0.2 + 0.15 + 0.1
"""Readings that come 0.2 s late, for 0.15 s."""
TRIALS = (
    Trial("xarm/drop", XARM, Act.ARM, ARM, "drop", ("disconnected",), WATCHDOG),
    Trial("xarm/delay", XARM, Act.ARM, ARM, "delay", ("disconnected", "timeout"), WATCHDOG, 0.2),
    Trial("xarm/protective_stop", XARM, Act.ARM, ARM, "protective_stop", ("collision",), AT_ONCE, undo="released"),
    Trial("xarm/joint_limit", XARM, Act.ARM, ARM, "joint_limit", ("fault",), AT_ONCE, undo="released"),
    Trial("xarm/gripper_jam", XARM, Act.HAND, ARM, "gripper_jam", ("fault",), 0.1 + AT_ONCE, undo="gripper_free"),
    Trial("xarm/platform_drop", XARM, Act.ARM, PLATFORM, "drop", ("stopped", "disconnected"), WATCHDOG),
    Trial("rosbridge/drop", XARM, Act.BASE, PLATFORM, "drop", ("disconnected",), WATCHDOG, rests_in=1.3),
    Trial("rosbridge/delay", XARM, Act.BASE, PLATFORM, "delay", ("stopped",), LATE, 0.2, rests_in=1.3),
    Trial("rosbridge/stale_odometry", XARM, Act.BASE, PLATFORM, "stale_odometry", ("stopped",), STALE,
          undo="fresh_odometry"),
    Trial("rosbridge/silent_odometry", XARM, Act.BASE, PLATFORM, "silent_odometry", ("stopped",), STALE,
          undo="fresh_odometry"),
    Trial("rosbridge/silent_scan", XARM, Act.BASE, PLATFORM, "silent_scan", ("no_data",), STALE + 0.1,
          undo="fresh_scan", stops=False),
    Trial("rosbridge/restart", XARM, Act.BASE, PLATFORM, "restart", ("disconnected",), AT_ONCE),
    Trial("rosbridge/blind", XARM, Act.LOOK, PLATFORM, "blind", ("camera_no_image",), 4.0, undo="sighted", stops=False),
    Trial("ur/drop", UR, Act.ARM, ARM, "drop", ("disconnected",), WATCHDOG),
    Trial("ur/delay", UR, Act.ARM, ARM, "delay", ("timeout", "disconnected"), LATE, 0.2),
    Trial("ur/protective_stop", UR, Act.ARM, ARM, "protective_stop", ("collision",), AT_ONCE, undo="released"),
    Trial("ur/joint_limit", UR, Act.ARM, ARM, "joint_limit", ("fault",), AT_ONCE, undo="released"),
    Trial("ur/emergency_stop", UR, Act.ARM, ARM, "emergency_stop", ("stopped",), AT_ONCE, undo="released"),
    Trial("ur/program_stop", UR, Act.ARM, ARM, "program_stop", ("fault",), AT_ONCE),
    Trial("robotiq/gripper_jam", UR, Act.HAND, HAND, "gripper_jam", ("fault",), AT_ONCE, undo="gripper_free"),
    Trial("robotiq/drop", UR, Act.HAND, HAND, "drop", ("disconnected",), WATCHDOG, rests_in=2.0),
    Trial("robotiq/delay", UR, Act.HAND, HAND, "delay", ("timeout", "disconnected"), LATE, 0.2, rests_in=2.0),
    Trial("ur/stale_odometry", UR, Act.BASE, PLATFORM, "stale_odometry", ("stopped",), STALE, undo="fresh_odometry"),
)  # fmt: skip


def run_trial(trial: Trial, twin: TwinProcess, setup: ResolvedConfig) -> Report:
    """A session of its own, and what is left of it."""
    left = LeftBehind()
    with open_session(setup) as session:
        report = strike(trial, twin, session, left.note)
    return replace(report, orphans=tuple(left.after(GRACE)))


def strike(trial: Trial, twin: TwinProcess, session: RobotSession, look: Callable[[], None] = lambda: None) -> Report:
    """Run the trial's tree in a session; ``look`` is called once while it is struck."""
    act = _Course(trial, twin, session, look)
    with act.over():
        execution = session.executor(session.load(act.tree()), act.tick).run()
    return act.report(execution.succeeded, execution.why)


class _Course:
    """Follows one trial, a step after each tick."""

    def __init__(self, trial: Trial, twin: TwinProcess, session: RobotSession, look: Callable[[], None]) -> None:
        self._trial, self._twin, self._session, self._look = trial, twin, session, look
        self._failures = session.skills.failures
        self._known = len(self._failures)
        self._set, self._at_rest, self._stopped = np.nan, False, None
        self._struck = False
        self._steps = self._follow()

    def tree(self) -> Node:
        """What is struck, and the recovery."""
        first, again = _acts(self._trial, self._session)
        pause = Sleep(msec=int(1000 * (self._trial.rests_in + 0.6)))
        clear = [ClearStop(attempts=5, wait=1.5)] if self._trial.stops else []
        return Fallback("trial", [first, Sequence("recovery", [pause, *clear, again])])

    def tick(self) -> None:
        """One step further, if there is one."""
        next(self._steps, None)

    @contextmanager
    def over(self) -> Iterator[None]:
        """Whatever happens, the fault is taken back."""
        try:
            yield
        finally:
            self._undo()

    def report(self, succeeded: bool, why: str) -> Report:
        """Once the tree has ended."""
        failed = self._failures[self._known :]
        if not failed:
            return Report(None, np.nan, "", f"the leaf did not fail; {why}", self._at_rest, False)
        first = failed[0]
        return Report(self._stopped, first.stamp - self._set, first.error_code, first.why, self._at_rest, succeeded)

    def _follow(self) -> Iterator[None]:
        trial, clock = self._trial, self._session.robot.clock
        before = place(self._twin)
        while trial.act is not Act.LOOK and np.max(np.abs(place(self._twin) - before)) < MOVING:
            yield
        self._set, self._struck = clock.now(), True
        self._twin.fault(trial.connection, trial.fault, trial.value)
        self._look()
        while len(self._failures) == self._known:
            yield
        robot = self._session.robot
        assert isinstance(robot, IsolatedRobot)
        stopped = robot.stopped_at
        self._stopped = stopped - self._set if stopped is not None and stopped > self._set else None
        while clock.now() < self._set + trial.rests_in:
            yield
        before = place(self._twin)
        until = clock.now() + 0.3
        while clock.now() < until:
            yield
        self._at_rest = bool(np.max(np.abs(place(self._twin) - before)) < RESTING)
        self._undo()

    def _undo(self) -> None:
        if self._struck:
            self._twin.fault(self._trial.connection, self._trial.undo)
            self._struck = False


def _acts(trial: Trial, session: RobotSession) -> tuple[Node, Node]:
    """What is struck, and what shows afterwards that the robot works again."""
    skills, setup = session.skills, session.setup
    match trial.act:
        case Act.ARM:
            here, names = skills.arm_positions(), skills.arm_model.joint_names
            near, far = sorted(
                ("home", "carry"), key=lambda name: np.abs(here - setup.robot_model.posture(name, names)).max()
            )
            return MoveArm(posture=far), MoveArm(posture=near)
        case Act.HAND:
            widths = sorted((0.0, skills.gripper.model.max_width), key=lambda w: abs(w - skills.gripper.width()))
            return MoveFingers(width=widths[1]), MoveFingers(width=widths[0])
        case Act.BASE:
            start = setup.world.robot_start
            here = skills.world.base.pose
            turned = start @ Pose2D(0.0, 0.0, 2.0)
            goals = [turned, start] if abs((start.inverse() @ here).theta) < 1.0 else [start, turned]
            # What it does about a sensor that is silent for a moment is no concern here.
            return NavigateTo(goal=goals[0], max_replans=0), NavigateTo(goal=goals[1], max_replans=0)
        case Act.LOOK:
            goal = setup.goals[0]
            names = {"object": goal.object, "surface": goal.source}
            return (
                Sequence("look", [Sleep(msec=500), DetectObject(**names)]),
                Sequence("look again", [LookAt(surface=goal.source), DetectObject(**names)]),
            )
