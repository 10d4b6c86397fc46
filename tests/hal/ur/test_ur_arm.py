"""What a UR's arm asks of its controller, and what it makes of the controller's reports."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hal.ur.arm
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.connection_config import SafetyConfig, WorkspaceConfig
from bestman_bt.robot_model.model import ArmModel, RobotModel
from hal.api import CommandRefusedError, Failure, Motion, MotionErrorCode, MotionStatus
from hal.parts.channels import JointChannel, JointReading
from hal.parts.gate import ToolLimits
from hal.parts.part_connection import ConnectionFailedError
from hal.parts.stop_latch import StopLatch
from hal.ur.arm import URArm
from hal.ur.sdk_process import PLAYING, RUNNING, Report
from tests.robot_models import with_limits

PERIOD = 0.01
HOME = np.radians([0.0, -120.0, 110.0, -80.0, -90.0, 0.0])
NUDGE = np.array([0.001, 0, 0, 0, 0, 0])


class Controller(JointChannel):
    """Joints that are where they were last sent; a path and a speed are what the controller makes of its calls."""

    def __init__(self) -> None:
        self.at, self.speed = HOME.copy(), np.zeros(6)
        self.calls: list[tuple[str, tuple[Any, ...]]] = []
        self.moving = False
        self.share = 1.0
        self.goal: np.ndarray | None = None
        self.lost: str | None = None

    def call(self, name: str, *arguments: Any, timeout: float) -> bool:
        if self.lost is not None:
            raise ConnectionFailedError(self.lost)
        self.calls.append((name, arguments))
        if name == "upload_path":
            self.goal = np.array(arguments[0][-1][:6])
        elif name == "start_path":
            self.moving = True
        elif name.startswith("stop"):
            self.moving, self.speed = False, np.zeros(6)
        return True

    def arrive(self) -> None:
        assert self.goal is not None
        self.at, self.moving = self.goal, False

    @property
    def scaling(self) -> float:
        return self.share

    @property
    def report(self) -> Report:
        lists = (self.at.tolist(), self.speed.tolist(), [0.0] * 6)
        return Report(0.0, 0.0, *lists, [0.0] * 6, [0.0] * 6, 0, 0, RUNNING, 1, PLAYING, False, self.moving)

    def read(self) -> JointReading:
        return JointReading(self.at, self.speed, np.zeros(6))

    def send(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        if self.share > 0.0:
            self.at = positions

    @property
    def asked(self) -> list[str]:
        return [name for name, _ in self.calls]


@pytest.fixture(scope="module")
def ur5() -> RobotModel:
    return load_robot_model("diff_ur5")


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The machine's clock as the arm sees it."""
    time = [100.0]
    monkeypatch.setattr(hal.ur.arm, "time", SimpleNamespace(monotonic=lambda: time[0]))
    return time


@pytest.fixture
def controller() -> Controller:
    return Controller()


@pytest.fixture
def make_arm(ur5: RobotModel, controller: Controller, now: list[float]) -> Callable[..., URArm]:
    def make(model: ArmModel | None = None, **safety: Any) -> URArm:
        model = model or ur5.of(ArmModel)["arm"]
        tool = ToolLimits(ur5, "arm", SafetyConfig(**safety))
        made = URArm("arm", model, controller, StopLatch(), PERIOD, tool, controller)
        made.attach()
        return made

    return make


@pytest.fixture
def arm(make_arm: Callable[..., URArm]) -> URArm:
    return make_arm()


@pytest.fixture
def run(arm: URArm, now: list[float]) -> Callable[[float], None]:
    def run_for(seconds: float) -> None:
        for _ in range(round(seconds / PERIOD)):
            now[0] += PERIOD
            arm.cycle(PERIOD)

    return run_for


Run = Callable[[float], None]


def until_done(motion: Motion, run: Run) -> None:
    for _ in range(1000):
        if motion.done:
            return
        run(PERIOD)
    raise AssertionError("the motion does not end")


def test_after_a_motion_that_has_succeeded_the_next_one_begins_at_once(
    arm: URArm, controller: Controller, run: Run
) -> None:
    """Whichever came before: 200 of each kind, each given in the very period in which the last one has ended."""
    begin: list[Callable[[np.ndarray], Motion]] = [
        arm.move_to,
        lambda place: arm.speed_tool([0.01, 0, 0, 0, 0, 0], 0.02),
        lambda place: arm.move_path([place]),
        lambda place: arm.speed_joints(NUDGE, 0.02),
    ]
    for number in range(800):
        kind = (number + number // 4) % 4
        motion = begin[kind](HOME + NUDGE * (number % 2))
        run(2 * PERIOD)
        if controller.moving:
            controller.arrive()
        until_done(motion, run)
        assert motion.status is MotionStatus.SUCCEEDED, motion.failure
        assert arm.resting


def test_a_motion_is_slower_by_the_controllers_scaling_waits_at_none_and_a_stop_then_moves_nothing(
    arm: URArm, controller: Controller, run: Run
) -> None:
    goal = HOME + 400 * NUDGE
    way: list[float] = []
    for scaling in (1.0, 0.25):
        controller.share = scaling
        motion, place = arm.move_to(goal if scaling == 1.0 else HOME), []
        while not motion.done:
            place.append(controller.at[0])
            run(PERIOD)
        assert motion.status is MotionStatus.SUCCEEDED
        way.append(float(np.max(np.abs(np.diff(place)))))
    assert way[1] == pytest.approx(0.25 * way[0], rel=0.05)
    controller.share = 1.0
    motion = arm.move_to(goal)
    run(0.3)
    controller.share, there = 0.0, controller.at.copy()
    run(1.0)
    assert not motion.done
    arm.stop()
    run(0.02)
    assert arm.resting
    controller.share = 1.0
    run(0.5)
    assert controller.at == pytest.approx(there)


def test_a_motion_that_did_not_settle_has_failed_and_the_next_one_begins_at_once(
    arm: URArm, controller: Controller, run: Run
) -> None:
    motion = arm.move_to(HOME + NUDGE)
    controller.speed = np.full(6, 0.1)  # it trembles
    until_done(motion, run)
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.TIMEOUT
    arm.speed_tool([0.01, 0, 0, 0, 0, 0], 0.1)


def test_a_path_is_sent_once_with_its_limits_and_a_blend_at_all_but_its_last_waypoint(
    make_arm: Callable[..., URArm], ur5: RobotModel, controller: Controller, now: list[float]
) -> None:
    joints = np.arange(6.0)
    arm = make_arm(with_limits(ur5.of(ArmModel)["arm"], velocity=3.0 - joints / 5, acceleration=4.0 + joints))
    arm.move_path([HOME + NUDGE, HOME], speed_scale=0.5, blend=0.02)
    now[0] += PERIOD
    arm.cycle(PERIOD)
    ((name, (rows,)),) = controller.calls
    assert name == "upload_path"
    assert [row[:6] for row in rows] == [(HOME + NUDGE).tolist(), HOME.tolist()]
    assert [row[8] for row in rows] == [0.02, 0.0]
    for row in rows:
        assert row[6:8] == pytest.approx([0.5 * 2.0, 0.5 * 4.0])  # of the slowest joint


def test_a_path_whose_tool_would_be_too_fast_is_slower_as_a_whole(
    make_arm: Callable[..., URArm], controller: Controller, now: list[float]
) -> None:
    fast, slow = make_arm(), make_arm(tool_speed=0.1)
    for arm in (fast, slow):
        arm.move_path([HOME + 500 * NUDGE, HOME])
        now[0] += PERIOD
        arm.cycle(PERIOD)
    free, bound = ((rows[0][6], rows[0][7]) for _, (rows,) in controller.calls)
    share = bound[0] / free[0]
    assert share < 0.5
    assert bound[1] == pytest.approx(free[1] * share**2)
    # A motion that ends faster than it begins: the slowest piece counts, wherever it is.
    controller.calls.clear()
    backwards = make_arm(tool_speed=0.1)
    backwards.move_path([HOME + NUDGE, HOME + 500 * NUDGE, HOME + 499 * NUDGE])
    now[0] += PERIOD
    backwards.cycle(PERIOD)
    assert controller.calls[0][1][0][0][6] < 0.5 * free[0]


def test_speeds_are_held_to_the_tools_limit_and_its_frame_is_the_urdfs(
    make_arm: Callable[..., URArm], controller: Controller, now: list[float]
) -> None:
    arm = make_arm(tool_speed=0.1)
    for twist in ([0.08, 0.08, 0, 0, 0, 0], [0, 0, -0.11, 0, 0, 0], [0.0] * 5, [np.nan] * 6, [np.inf, 0, 0, 0, 0, 0]):
        with pytest.raises(CommandRefusedError, match="speed_tool"):
            arm.speed_tool(twist, 1.0)
    for duration in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(CommandRefusedError, match="duration"):
            arm.speed_tool([0.05, 0, 0, 0, 0, 0], duration)
        with pytest.raises(CommandRefusedError, match="duration"):
            arm.speed_joints(NUDGE, duration)
    with pytest.raises(CommandRefusedError, match="faster than its limit"):
        arm.speed_joints([0.5, 0, 0, 0, 0, 0], 1.0)
    arm.speed_tool([0.01, 0.02, 0.03, 0.04, 0.05, 0.06], 0.5)
    now[0] += PERIOD
    arm.cycle(PERIOD)
    ((name, (twist, _)),) = controller.calls
    assert name == "speed_tool"
    assert twist == pytest.approx([-0.01, -0.02, 0.03, -0.04, -0.05, 0.06])


def test_a_way_out_of_the_workspace_is_refused_also_in_the_middle_of_a_path(
    make_arm: Callable[..., URArm], ur5: RobotModel
) -> None:
    place = ToolLimits(ur5, "arm", SafetyConfig()).tool(HOME)
    box = WorkspaceConfig((-1.0, -1.0, 0.0), (1.0, place[1] + 0.05, 2.0))
    arm = make_arm(workspace=box)
    with pytest.raises(CommandRefusedError, match="workspace"):
        arm.move_path([HOME + NUDGE, HOME + 800 * NUDGE, HOME])
    arm.move_path([HOME + NUDGE, HOME])


def test_the_way_between_two_waypoints_counts_and_not_those_from_the_start(make_arm: Callable[..., URArm]) -> None:
    left = HOME + np.array([0.9, 0.3, -0.5, 0, 0, 0])
    right = HOME + np.array([-1.0, 0.5, -0.6, 0, 0, 0])
    box = WorkspaceConfig((-1.0, -1.0, 0.0), (0.58, 1.0, 2.0))
    for waypoint in (left, right):
        make_arm(workspace=box).move_path([waypoint])
    with pytest.raises(CommandRefusedError, match="workspace"):
        make_arm(workspace=box).move_path([left, right])


@pytest.mark.parametrize("end", ["cancel", "stop"])
def test_a_motion_of_the_controller_that_is_ended_is_stopped_there_before_anything_else_begins(
    arm: URArm, controller: Controller, run: Run, end: str
) -> None:
    for begin, stop_call in (
        (lambda: arm.move_path([HOME + 300 * NUDGE]), "stop_path"),
        (lambda: arm.speed_joints(100 * NUDGE, 5.0), "stop_speed"),
        (lambda: arm.speed_tool([0.05, 0, 0, 0, 0, 0], 5.0), "stop_speed"),
    ):
        controller.calls.clear()
        motion = begin()
        run(0.05)
        begun = len(controller.calls)
        motion.cancel() if end == "cancel" else arm.stop()
        assert motion.status is MotionStatus.CANCELED
        for command in (arm.move_to, arm.servo, arm.command):
            with pytest.raises(CommandRefusedError, match="stop"):
                command(HOME)
        with pytest.raises(CommandRefusedError, match="still moves"):
            arm.speed_joints(NUDGE, 1.0)
        assert not arm.resting
        run(PERIOD)
        assert controller.asked[begun:] == [stop_call]
        assert arm.resting
        assert motion.status is MotionStatus.CANCELED


@pytest.mark.parametrize("uploaded", [False, True])
def test_a_path_that_is_ended_before_or_during_its_upload_never_begins(
    arm: URArm, controller: Controller, run: Run, uploaded: bool
) -> None:
    motion = arm.move_path([HOME + 300 * NUDGE])
    if uploaded:
        run(PERIOD)
        assert controller.asked == ["upload_path"]
    motion.cancel()
    run(0.3)
    assert "start_path" not in controller.asked
    assert arm.resting


def test_a_motion_of_the_controller_is_not_over_by_reports_from_before_it(
    arm: URArm, controller: Controller, run: Run
) -> None:
    path = arm.move_path([HOME])
    controller.moving = False
    run(0.05)
    assert not path.done
    run(0.2)
    controller.moving = False
    until_done(path, run)
    speed = arm.speed_joints(NUDGE, 0.3)
    run(0.28)
    assert not speed.done
    until_done(speed, run)
    assert controller.asked[-1] == "stop_speed"


def test_no_motion_of_the_controller_begins_while_the_operator_holds_the_arm(
    arm: URArm, controller: Controller, run: Run
) -> None:
    arm.speed_share = 0.0
    motion = arm.speed_joints(-300 * NUDGE, 1.0)
    run(0.5)
    assert controller.asked == []
    assert not motion.done
    arm.speed_share = 1.0
    run(PERIOD)
    assert controller.asked == ["speed_joints"]


def test_a_speed_is_renewed_ten_times_a_second_at_least_and_stopped_after_its_duration(
    arm: URArm, controller: Controller, run: Run
) -> None:
    motion = arm.speed_joints(-300 * NUDGE, 1.0)
    run(PERIOD)
    controller.speed = np.array([-0.3, 0, 0, 0, 0, 0])
    run(0.98)
    assert not motion.done
    assert controller.asked[0] == "speed_joints"
    assert set(controller.asked[1:]) == {"renew"}
    assert len(controller.asked) > 10
    run(0.05)
    assert controller.asked[-1] == "stop_speed"
    assert motion.status is MotionStatus.SUCCEEDED


def test_a_path_that_ends_elsewhere_has_failed(arm: URArm, controller: Controller, run: Run) -> None:
    for off, status in ((0.009, MotionStatus.SUCCEEDED), (0.011, MotionStatus.FAILED)):
        motion = arm.move_path([HOME + 100 * NUDGE])
        run(0.05)
        controller.arrive()
        controller.at = controller.at - np.array([0, 0, 0, 0, 0, off])
        until_done(motion, run)
        assert motion.status is status, motion.failure
    assert motion.failure is not None
    assert "ended elsewhere" in motion.failure.text


def test_a_controller_that_is_faster_than_allowed_or_leaves_the_workspace_is_stopped(
    make_arm: Callable[..., URArm], controller: Controller, ur5: RobotModel, now: list[float]
) -> None:
    place = ToolLimits(ur5, "arm", SafetyConfig()).tool(HOME)
    arm = make_arm(workspace=WorkspaceConfig((-1.0, -1.0, 0.0), (1.0, place[1] + 0.05, 2.0)))
    limit = arm.model.velocity[0]
    for speed, at, words in (
        (1.05 * limit, HOME, ""),
        (-1.15 * limit, HOME, "faster than its limit"),
        (0.0, HOME + 300 * NUDGE, "workspace"),
    ):
        controller.at = HOME
        motion = arm.speed_joints(NUDGE, 50.0)
        for _ in range(3):
            now[0] += PERIOD
            arm.cycle(PERIOD)
            controller.speed, controller.at = np.array([speed, 0, 0, 0, 0, 0]), at
        assert motion.done is bool(words)
        if words:
            assert motion.failure is not None
            assert motion.failure.code is MotionErrorCode.FAULT
            assert words in motion.failure.text
        else:
            motion.cancel()
            arm.cycle(PERIOD)
        assert controller.asked[-1] == "stop_speed"
        assert arm.resting
        controller.speed = np.zeros(6)


def test_a_fault_ends_the_controllers_motion_and_a_lost_link_fails_it(
    arm: URArm, controller: Controller, run: Run
) -> None:
    motion = arm.move_path([HOME + 300 * NUDGE])
    run(0.05)
    arm.fail(Failure(MotionErrorCode.COLLISION, "protective stop", vendor_code="safety mode 3"))
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.COLLISION
    run(PERIOD)
    assert controller.asked == ["upload_path", "start_path", "stop_path"]
    motion = arm.speed_joints(NUDGE, 5.0)
    controller.lost = "the process of the UR's SDK has ended"
    run(PERIOD)
    assert motion.failure is not None
    assert "SDK has ended" in motion.failure.text
    controller.lost = None
    arm.move_path([HOME])
    arm.attach()  # as after a recovery: nothing goes on
    assert arm.resting
    arm.move_to(HOME)


def test_after_a_path_set_points_go_on_from_where_it_ended(arm: URArm, controller: Controller, run: Run) -> None:
    motion = arm.move_path([HOME + 300 * NUDGE])
    run(0.05)
    controller.arrive()
    until_done(motion, run)
    arm.move_to(HOME)
    run(PERIOD)
    assert controller.at == pytest.approx(HOME + 300 * NUDGE, abs=0.01)
