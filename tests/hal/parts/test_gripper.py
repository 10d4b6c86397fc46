"""A gripper over a channel: when a motion has succeeded, what counts as held, and what a stop does."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from bestman_bt.robot_model.model import GripperModel, RobotModel
from hal.api import CommandRefusedError, Failure, Motion, MotionErrorCode, MotionStatus, NoDataError, NotConnectedError
from hal.parts.channels import GripperChannel, GripperReading
from hal.parts.gripper import CommandedGripper
from hal.parts.stop_latch import StopLatch

PERIOD = 0.02


class Fingers(GripperChannel):
    """Fingers that go where they are sent, but no further than ``low`` and ``high``."""

    def __init__(self) -> None:
        self.width = self.target = 0.08
        self.speed, self.low, self.high = 0.0, 0.0, 1.0
        self.felt: bool | None = None
        self.orders: list[tuple[float, float, float]] = []
        self.halts = 0
        self.silent = False
        self.during: Callable[[], object] | None = None

    def refresh(self) -> bool:
        during, self.during = self.during, None
        if during is not None:
            during()
        return not self.silent

    def read(self) -> GripperReading:
        return GripperReading(self.width, self.felt)

    def send(self, width: float, force: float, speed: float) -> None:
        self.orders.append((width, force, speed))
        self.target, self.speed = width, speed

    def halt(self) -> None:
        self.halts += 1
        self.target = self.width

    def move(self, dt: float) -> None:
        step = self.speed * dt
        self.width += min(max(self.target - self.width, -step), step)
        self.width = min(max(self.width, self.low), self.high)


@pytest.fixture
def latch() -> StopLatch:
    return StopLatch()


@pytest.fixture
def fingers() -> Fingers:
    return Fingers()


@pytest.fixture
def gripper(robot_model: RobotModel, fingers: Fingers, latch: StopLatch) -> CommandedGripper:
    made = CommandedGripper("gripper", robot_model.of(GripperModel)["gripper"], fingers, latch)
    made.attach()
    return made


def run(gripper: CommandedGripper, fingers: Fingers, seconds: float) -> None:
    for _ in range(round(seconds / PERIOD)):
        gripper.cycle(PERIOD)
        fingers.move(PERIOD)


@pytest.mark.parametrize(("felt", "seconds"), [(None, 0.8), (False, 1.6)])
def test_fingers_of_which_nothing_is_heard_neither_hold_nor_are_stuck(
    gripper: CommandedGripper, fingers: Fingers, felt: bool | None, seconds: float
) -> None:
    fingers.felt, fingers.low = felt, 0.04
    motion = gripper.move(0.0, speed=0.05)
    run(gripper, fingers, 0.5)
    fingers.silent = True
    run(gripper, fingers, seconds)
    assert motion.status is MotionStatus.RUNNING
    assert not gripper.state().object_held
    fingers.silent = False
    run(gripper, fingers, seconds)
    assert gripper.state().object_held is (felt is None)
    assert motion.status is (MotionStatus.SUCCEEDED if felt is None else MotionStatus.FAILED)
    fingers.silent = True
    motion = gripper.move(0.08)
    run(gripper, fingers, 6.0)
    assert motion.failure is not None
    assert "does not answer" in str(motion.failure)


def test_an_order_is_sent_once_with_its_force_and_speed(gripper: CommandedGripper, fingers: Fingers) -> None:
    motion = gripper.move(0.03, force=20.0, speed=0.05)
    assert not gripper.resting
    run(gripper, fingers, 0.9)
    assert not motion.done
    run(gripper, fingers, 0.2)
    assert motion.status is MotionStatus.SUCCEEDED
    assert fingers.orders == [(0.03, 20.0, 0.05)]
    state = gripper.state()
    assert (state.at_target, state.moving, state.object_held, state.empty) == (True, False, False, True)
    run(gripper, fingers, 0.1)
    gripper.move(0.029)
    state = gripper.state()  # near enough already, but it has yet to settle there
    assert (state.at_target, state.moving, state.empty) == (True, True, False)
    assert gripper.move(0.06).status is MotionStatus.RUNNING
    run(gripper, fingers, 1.0)
    assert not gripper.state().empty


def test_fingers_keep_to_the_operators_speed_wait_while_held_and_are_not_taken_for_blocked(
    gripper: CommandedGripper, fingers: Fingers
) -> None:
    gripper.speed_share = 0.05
    motion = gripper.move(0.03, force=20.0, speed=0.04)  # 2 mm/s: less than the still band in the still time
    run(gripper, fingers, 2.0)
    assert fingers.orders == [(0.03, 20.0, pytest.approx(0.002))]
    assert fingers.width == pytest.approx(0.076, abs=3e-4)
    gripper.speed_share = 0.0
    run(gripper, fingers, 30.0)
    assert (fingers.halts, fingers.width) == (1, pytest.approx(0.076, abs=3e-4))
    gripper.speed_share = 1.0
    run(gripper, fingers, 0.5)
    assert motion.status is MotionStatus.RUNNING
    assert fingers.orders[1:] == [(0.03, 20.0, 0.04)]
    run(gripper, fingers, 1.0)
    assert motion.status is MotionStatus.SUCCEEDED
    gripper.speed_share = 0.5
    run(gripper, fingers, 0.1)
    assert len(fingers.orders) == 2  # what rests is told nothing


def test_closing_on_an_object_succeeds_and_holds_until_it_is_gone(gripper: CommandedGripper, fingers: Fingers) -> None:
    fingers.low = 0.03
    motion = gripper.close(force=30.0)
    run(gripper, fingers, 3.0)
    assert motion.status is MotionStatus.SUCCEEDED
    assert gripper.state().object_held
    assert not gripper.state().empty
    fingers.width = 0.03 + 0.001  # it trembles
    run(gripper, fingers, 0.1)
    assert gripper.state().object_held
    fingers.low = 0.0
    run(gripper, fingers, 1.0)
    assert not gripper.state().object_held
    fingers.low = 0.03  # and does not come back by itself
    fingers.width = 0.03
    run(gripper, fingers, 1.0)
    assert not gripper.state().object_held


def test_what_the_gripper_itself_feels_ends_the_motion_at_once(gripper: CommandedGripper, fingers: Fingers) -> None:
    motion = gripper.close()
    run(gripper, fingers, 0.1)
    fingers.felt, fingers.low = True, fingers.width
    run(gripper, fingers, 0.04)
    assert motion.status is MotionStatus.SUCCEEDED
    assert gripper.state().object_held


@pytest.mark.parametrize("halted", [False, True])
def test_a_command_during_a_cycle_is_not_judged_by_the_reading_from_before_it(
    gripper: CommandedGripper, fingers: Fingers, halted: bool
) -> None:
    fingers.low = 0.03
    gripper.move(0.0, speed=0.05)
    if halted:
        run(gripper, fingers, 0.3)
        gripper.brake()
    else:
        run(gripper, fingers, 2.0)
        fingers.felt = True  # until it is sent elsewhere
    opened: list[Motion[None]] = []
    fingers.during = lambda: opened.append(gripper.open())
    run(gripper, fingers, PERIOD)
    assert opened[0].status is MotionStatus.RUNNING, opened[0].failure
    fingers.felt, fingers.low = None, 0.0
    run(gripper, fingers, 2.0)
    assert opened[0].status is MotionStatus.SUCCEEDED
    assert gripper.width() == pytest.approx(gripper.model.max_width)


def test_fingers_get_time_to_begin_and_are_not_taken_for_blocked(gripper: CommandedGripper, fingers: Fingers) -> None:
    fingers.low = fingers.width  # a slow valve
    motion = gripper.close()
    run(gripper, fingers, 0.55)
    assert not motion.done
    fingers.low = 0.0
    run(gripper, fingers, 2.0)
    assert motion.status is MotionStatus.SUCCEEDED
    assert gripper.state().empty


def test_opening_that_is_blocked_is_stuck_and_slow_is_too_slow(gripper: CommandedGripper, fingers: Fingers) -> None:
    gripper.close()
    run(gripper, fingers, 3.0)
    fingers.high = 0.02
    motion = gripper.open()
    run(gripper, fingers, 3.0)
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.FAULT
    assert "stuck" in motion.failure.text
    assert not gripper.state().object_held
    fingers.high = 1.0
    motion = gripper.open()
    gripper.cycle(PERIOD)
    fingers.speed = 0.006  # not still, but never there
    run(gripper, fingers, 3.4)
    assert not motion.done
    run(gripper, fingers, 1.0)
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.TIMEOUT


def test_a_stop_halts_moving_fingers_once_and_lets_a_grasp_press_on(
    gripper: CommandedGripper, fingers: Fingers
) -> None:
    motion = gripper.move(0.0, speed=0.05)
    run(gripper, fingers, 0.6)
    gripper.stop()
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.STOPPED
    assert not gripper.resting
    run(gripper, fingers, 0.5)
    assert (fingers.halts, len(fingers.orders)) == (1, 1)
    assert fingers.width == pytest.approx(0.05, abs=0.003)
    assert gripper.resting
    assert gripper.state().at_target
    fingers.low = 0.03
    gripper.close()
    run(gripper, fingers, 0.9)  # it has been blocked for a moment
    gripper.stop()
    run(gripper, fingers, 0.2)
    assert fingers.halts == 1
    assert fingers.target == 0.0


def test_a_stop_before_the_order_was_sent_keeps_it_back(gripper: CommandedGripper, fingers: Fingers) -> None:
    gripper.close()
    gripper.stop()
    run(gripper, fingers, 0.5)
    assert fingers.orders == []
    assert fingers.width == 0.08
    gripper.stop()
    assert gripper.resting
    gripper.close()
    gripper.fail(Failure(MotionErrorCode.COLLISION, "the arm"))
    run(gripper, fingers, 0.5)
    assert fingers.orders == []


def test_a_stop_halts_fingers_that_have_not_begun_to_move_yet(gripper: CommandedGripper, fingers: Fingers) -> None:
    fingers.low = fingers.width  # a slow valve
    gripper.close()
    run(gripper, fingers, 0.3)
    gripper.stop()
    fingers.low = 0.0
    run(gripper, fingers, 0.5)
    assert (fingers.halts, fingers.width) == (1, 0.08)


def test_a_newer_order_takes_over_from_a_halt(gripper: CommandedGripper, fingers: Fingers) -> None:
    first = gripper.move(0.0, speed=0.05)
    run(gripper, fingers, 0.3)
    first.cancel()
    second = gripper.move(0.02)
    run(gripper, fingers, 2.0)
    assert fingers.halts == 0
    assert second.status is MotionStatus.SUCCEEDED
    assert fingers.width == pytest.approx(0.02, abs=0.001)


def test_attached_again_it_stays_where_it_is_and_detached_it_refuses(
    gripper: CommandedGripper, fingers: Fingers, latch: StopLatch
) -> None:
    motion = gripper.close()
    gripper.detach()
    assert motion.failure is not None
    assert motion.failure.code is MotionErrorCode.DISCONNECTED
    with pytest.raises(NotConnectedError):
        gripper.open()
    fingers.width = 0.04
    gripper.attach()
    run(gripper, fingers, 0.3)
    assert (fingers.orders, fingers.halts) == ([], 0)
    assert gripper.state().at_target
    assert gripper.width() == 0.04
    fingers.low = 0.03
    gripper.close()
    run(gripper, fingers, 2.0)
    assert gripper.state().object_held
    gripper.detach()
    gripper.attach()
    fingers.width = 0.05  # opened by hand, whatever it held
    run(gripper, fingers, 0.1)
    assert not gripper.state().object_held
    latch.set()
    with pytest.raises(CommandRefusedError, match="stopped"):
        gripper.open()


@pytest.mark.parametrize(
    ("order", "what"),
    [
        ((-0.001, None, None), "width"),
        ((0.081, None, None), "width"),
        ((float("nan"), None, None), "width"),
        ((0.02, 0.0, None), "force"),
        ((0.02, 1e4, None), "force"),
        ((0.02, None, -0.1), "speed"),
        ((0.02, None, 10.0), "speed"),
    ],
)
def test_an_order_beyond_a_limit_is_refused_and_nothing_is_sent(
    gripper: CommandedGripper, fingers: Fingers, order: tuple[float, float | None, float | None], what: str
) -> None:
    with pytest.raises(CommandRefusedError, match=f"gripper refused move: {what} = "):
        gripper.move(*order)
    run(gripper, fingers, 0.1)
    assert fingers.orders == []


def test_it_has_no_width_before_it_was_read(robot_model: RobotModel, latch: StopLatch) -> None:
    class Silent(Fingers):
        def read(self) -> GripperReading:
            raise NoDataError("it has not reported anything yet")

    gripper = CommandedGripper("gripper", robot_model.of(GripperModel)["gripper"], Silent(), latch)
    with pytest.raises(NotConnectedError):
        gripper.width()
    with pytest.raises(NoDataError):
        gripper.attach()
    with pytest.raises(NotConnectedError):  # and is not connected then
        gripper.width()


def test_fingers_that_creep_below_any_speed_limit_are_not_blocked(gripper: CommandedGripper, fingers: Fingers) -> None:
    motion = gripper.close()
    gripper.cycle(PERIOD)
    fingers.speed = 0.003  # 0.6 mm in the time after which fingers at rest count as blocked
    run(gripper, fingers, 2.0)
    assert not motion.done


def test_an_object_that_yields_is_held_once_the_fingers_rest(gripper: CommandedGripper, fingers: Fingers) -> None:
    motion = gripper.close()
    for tremble in (0.0302, 0.0300, 0.0298) * 40:  # within the band that counts as rest
        gripper.cycle(PERIOD)
        fingers.width = tremble
    assert motion.status is MotionStatus.SUCCEEDED
    assert gripper.state().object_held


def test_a_gripper_that_reacts_at_once_is_blocked_after_the_time_of_rest_alone(
    gripper: CommandedGripper, fingers: Fingers
) -> None:
    fingers.reaction_time = 0.0
    fingers.low = fingers.width
    motion = gripper.close()
    run(gripper, fingers, 0.2)
    assert not motion.done
    run(gripper, fingers, 0.04)
    assert motion.status is MotionStatus.SUCCEEDED
    assert gripper.state().object_held


def test_fingers_that_stand_still_and_feel_nothing_are_given_time_before_they_count_as_stuck(
    gripper: CommandedGripper, fingers: Fingers
) -> None:
    """Of a gripper that feels objects: what it does not feel does not hold its fingers up for long."""
    fingers.low, fingers.felt, fingers.reaction_time = 0.03, False, 0.0
    motion = gripper.close(force=30.0)
    run(gripper, fingers, 1.2)  # half a second of it on the way
    assert not motion.done
    run(gripper, fingers, 0.6)
    assert motion.status is MotionStatus.FAILED
    assert motion.failure is not None
    assert (motion.failure.code, "is stuck" in motion.failure.text) == (MotionErrorCode.FAULT, True)
    assert not gripper.state().object_held
    gripper.open()
    run(gripper, fingers, 1.0)
    motion = gripper.close(force=30.0)
    run(gripper, fingers, 0.9)
    fingers.felt = True  # in time
    run(gripper, fingers, 0.1)
    assert motion.status is MotionStatus.SUCCEEDED
    assert gripper.state().object_held


def test_what_the_gripper_feels_again_is_held_again(gripper: CommandedGripper, fingers: Fingers) -> None:
    """A seal that was broken for an instant; the width alone does not bring an object back."""
    fingers.low, fingers.felt = 0.03, True
    gripper.close()
    run(gripper, fingers, 1.0)
    fingers.low, fingers.felt = 0.0, False
    run(gripper, fingers, 1.0)
    assert not gripper.state().object_held
    fingers.low, fingers.felt = 0.03, True
    run(gripper, fingers, 0.1)
    assert gripper.state().object_held
    fingers.low = 0.0
    gripper.open()
    run(gripper, fingers, 1.0)
    assert not gripper.state().object_held
