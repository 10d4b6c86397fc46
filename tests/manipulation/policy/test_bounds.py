"""What keeps a policy's actions within bounds: joint limits, the workspace, and what no chunk may be."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.policy.base import ActionChunk, Observation, Policy
from bestman_bt.manipulation.policy.chunk_stream import ChunkStream, chunk_path
from bestman_bt.manipulation.policy.errors import (
    PolicyActionError,
    PolicyModelError,
    PolicyObservationError,
    StaleChunkError,
)
from bestman_bt.manipulation.policy.features import feature_vector, pose_error, pose_vector
from bestman_bt.manipulation.policy.onnx_policy import PolicyNormalization
from bestman_bt.manipulation.policy.specification import ActionSpace, PolicySpecification, Workspace
from bestman_bt.manipulation.policy.training.reaching import Rollout, roll_out
from bestman_bt.manipulation.trajectory.base import SpeedScale
from bestman_bt.messages import Pose
from tests.manipulation.kinematics.slides import LIMITS, Slides, at
from tests.rigs.limit_usage import limit_usage
from tests.robot_models import joint_group_model

DELTAS, POSITIONS, TWIST = ActionSpace.JOINT_DELTAS, ActionSpace.JOINT_POSITIONS, ActionSpace.TOOL_TWIST


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("space", [DELTAS, POSITIONS])
def test_actions_are_held_inside_both_limits_and_the_start_is_left_alone(space: ActionSpace, sign: float) -> None:
    """An arm that sags a little beyond its limit is told to come back, not said to be elsewhere."""
    start = np.array([1.01 * sign, 0.0])
    path = chunk_path(ActionChunk(np.full((3, 2), 2.0 * sign), 0.1, space), start, Slides(), LIMITS)
    assert np.array_equal(path[0], start)
    assert path[1:] == pytest.approx(np.full((3, 2), sign))


def test_a_twist_is_followed_from_step_to_step_in_the_directions_of_the_base(kinematics, arm, ready) -> None:
    """The tool is turned: its own x is not the base's; and the way is too long for one step of tracking."""
    twist = np.tile([0.0, 0.2, 0.0, 0.0, 0.0, 0.5], (8, 1))
    path = chunk_path(ActionChunk(twist, 0.2, TWIST), ready, kinematics, arm)
    before, after = kinematics.tool_pose(ready), kinematics.tool_pose(path[-1])
    assert after.position - before.position == pytest.approx([0.0, 0.32, 0.0], abs=1e-3)
    assert pose_error(after, before)[3:] == pytest.approx([0.0, 0.0, 0.8], abs=1e-2)
    tilted = np.tile([0.0, 0.0, 0.0, 0.3, 0.0, 0.0], (2, 1))
    end = chunk_path(ActionChunk(tilted, 0.5, TWIST), ready, kinematics, arm)[-1]
    assert pose_error(kinematics.tool_pose(end), before)[3:] == pytest.approx([0.3, 0.0, 0.0], abs=1e-2)


BOX = Workspace(np.array([-0.5, -0.1, -0.2]), np.array([0.5, 0.1, 0.2]))


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_box_has_six_sides_and_a_slack(axis: int, sign: float) -> None:
    point = np.zeros(3)
    point[axis] = sign * (BOX.upper[axis] + 0.01)
    assert not BOX.contains(point)
    assert not BOX.contains(point, slack=0.009)
    assert BOX.contains(point, slack=0.011)
    point[axis] = sign * (BOX.upper[axis] - 0.001)
    assert BOX.contains(point)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_leaving_the_box_is_seen_on_the_way_at_its_end_and_only_there(sign: float) -> None:
    """The tool is at a + b: out, where that is beyond 0.5."""
    path = sign * np.array([[0.0, 0.0], [0.24, 0.24], [0.27, 0.24]])
    assert BOX.first_outside(path[:2], Slides()) is None
    outside = BOX.first_outside(path, Slides())
    assert outside is not None
    assert outside[0] == pytest.approx(sign * 0.51, abs=0.011)
    there_and_back = sign * np.array([[0.0, 0.0], [0.3, 0.3], [0.0, 0.0]])
    assert BOX.first_outside(there_and_back, Slides())[0] == pytest.approx(sign * 0.5, abs=0.05)


def test_a_hop_out_of_the_box_between_two_waypoints_inside_is_seen() -> None:
    """The tool swings out on an arc: both ends are at x = 0.4, half-way it is at 0.6."""

    class Bow(Slides):
        def tool_pose(self, positions):
            return at(0.6 - 0.8 * float(positions[0]) ** 2)

    path = np.array([[-0.5, 0.0], [0.5, 0.0]])
    for way in (path, path[::-1]):
        assert BOX.first_outside(way, Bow()) is not None


def test_a_box_is_read_corner_by_corner() -> None:
    box = Workspace.from_string("-0.5;-0.1;-0.2;0.5;0.1;0.2")
    assert np.array_equal(box.lower, BOX.lower)
    assert np.array_equal(box.upper, BOX.upper)
    assert str(box) == "x -0.50 to 0.50, y -0.10 to 0.10, z -0.20 to 0.20 m"


@pytest.mark.parametrize("widths", [np.zeros(3), np.array([0.0, np.nan]), np.array([0.0, np.inf]), np.zeros((2, 1))])
def test_widths_that_fit_no_chunk_are_refused(widths: np.ndarray) -> None:
    with pytest.raises(PolicyActionError, match=r"gripper_widths should be \(2,\) and finite"):
        ActionChunk(np.zeros((2, 3)), 0.1, DELTAS, widths)


@pytest.mark.parametrize("dt", [0.0, -0.1, float("nan"), float("inf")])
def test_a_chunk_takes_some_finite_time(dt: float) -> None:
    with pytest.raises(PolicyActionError, match="dt should be above 0 s"):
        ActionChunk(np.zeros((2, 3)), dt, DELTAS)
    assert ActionChunk(np.zeros((5, 3)), 0.1, DELTAS).duration == pytest.approx(0.5)


@pytest.mark.parametrize("field", ["joint_positions", "goal", "joint_velocities"])
@pytest.mark.parametrize("value", [np.array([0.0, np.inf]), np.zeros((2, 2))])
def test_what_is_seen_is_finite_and_a_row(field: str, value: np.ndarray) -> None:
    given = {"joint_positions": np.zeros(2), field: value}
    with pytest.raises(PolicyObservationError, match=f"Observation {field} should be a finite"):
        Observation(base_from_tool=Pose(), **given)


def test_what_was_answered_and_seen_cannot_be_changed_afterwards() -> None:
    chunk, seen = ActionChunk(np.zeros((2, 3)), 0.1, DELTAS), Observation(np.zeros(2), Pose())
    for values in (chunk.actions, seen.joint_positions, seen.goal):
        assert not values.flags.writeable


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"horizon": -1}, "horizon should be a whole number"),
        ({"horizon": True}, "horizon should be a whole number"),
        ({"open_width": -0.01}, "open_width should be a finite number not below 0"),
        ({"open_width": float("inf")}, "open_width should be"),
        ({"space": "joint_torques"}, "space should be one of"),
        ({"images": {"head": (48, 0)}}, "images of 'head' should have a height and a width above 0"),
        ({"workspace": ((0.0, 0.0, 0.0), (1.0, 1.0, float("inf")))}, "a lower and an upper corner"),
        ({"workspace": ((0.0, 0.0), (1.0, 1.0))}, "a lower and an upper corner"),
        ({"joint_names": []}, "at least one joint"),
        ({"speed": 3}, "unknown field 'speed'"),
    ],
)
def test_a_specification_reports_what_can_be(wrong: dict, told: str) -> None:
    right = PolicySpecification(("a", "b"), "joint_deltas", 4, 0.1).to_dict()
    with pytest.raises(PolicyModelError, match=told):
        PolicySpecification.from_dict(right | wrong)


@pytest.mark.parametrize(
    "wrong",
    [{"output_scale": [1.0, 0.0]}, {"input_scale": [-1.0]}, {"input_mean": [np.nan]}, {"output_mean": [1.0]}],
)
def test_a_normalisation_that_cannot_be_undone_is_refused(wrong: dict) -> None:
    right = {"input_mean": [0.0], "input_scale": [1.0], "output_mean": [0.0, 1.0], "output_scale": [1.0, 2.0]}
    assert PolicyNormalization.from_dict(right).to_dict() == right
    with pytest.raises(PolicyModelError, match="should be finite and of equal length, with scales above 0"):
        PolicyNormalization.from_dict(right | wrong)


def test_features_are_what_their_names_say() -> None:
    """The tool is turned by a quarter about x, the goal by as much about z more, in the base frame."""
    tool = Pose.from_xyz_rpy((0.1, 0.2, 0.3), (np.pi / 2, 0.0, 0.0))
    goal = Pose.from_xyz_rpy((0.13, 0.2, 0.27), (np.pi / 2, 0.0, np.pi / 2))
    seen = Observation(np.array([1.0, 2.0]), tool, pose_vector(goal), 0.04, joint_velocities=np.array([3.0, 4.0]))

    def of(name: str) -> np.ndarray:
        return feature_vector(seen, [name])

    assert of("goal_error") == pytest.approx([0.03, 0.0, -0.03, 0.0, 0.0, np.pi / 2])
    assert of("goal_offset") == pytest.approx([0.03, 0.0, -0.03])
    assert of("goal_offset_near") == pytest.approx(np.tanh([1.0, 0.0, -1.0]))
    assert of("tool_axes") == pytest.approx([1.0, 0.0, 0.0, 0.0, -1.0, 0.0], abs=1e-9)
    assert of("tool_pose") == pytest.approx(pose_vector(tool))
    assert feature_vector(seen, ["joint_velocities", "gripper_width", "joint_positions"]).tolist() == [3, 4, 0.04, 1, 2]


JOINTS = joint_group_model(
    ("a", "b"), lower=(-1.0, -0.5), upper=(1.0, 0.5), velocity=(1.0, 2.0), acceleration=(4.0, 8.0)
)
DT = 0.1


def going(start: list[float], step: list[float], count: int = 10) -> np.ndarray:
    return np.array(start) + np.arange(count + 1)[:, None] * np.array(step)


@pytest.fixture
def stream() -> ChunkStream:
    return ChunkStream(JOINTS, speed=SpeedScale(0.5, 0.5))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_motion_keeps_a_margin_from_both_limits_or_begins_nearer(stream: ChunkStream, sign: float) -> None:
    beyond = stream.splice(going([0.6 * sign, 0.0], [0.05 * sign, 0.0]), DT, 0.0, 0.0).trajectory
    assert np.abs(beyond.positions[:, 0]).max() <= 0.98
    assert beyond.positions[-1, 0] == pytest.approx(0.97 * sign)
    near = stream.splice(going([0.99 * sign, 0.0], [0.0, 0.02]), DT, 0.0, 0.0).trajectory
    assert near.positions[:, 0] == pytest.approx(0.99 * sign, abs=1e-6)
    outside = going([1.05 * sign, 0.0], [0.0, 0.02])
    with pytest.raises(PolicyActionError, match="along the chunk a would pass its limit"):
        stream.splice(outside, DT, 0.0, 0.0)


@pytest.mark.parametrize(
    "path",
    [going([0, 0], [0.08, -0.04]), going([0, 0], [-0.08, 0.04]), np.array([[0, 0], [0.1, 0], [0, 0], [0.1, 0.0]])],
)
def test_limits_are_kept_however_hasty_or_jerky_the_chunk_is(stream: ChunkStream, path: np.ndarray) -> None:
    motion = stream.splice(path, DT, 0.0, 0.0)
    usage = limit_usage(motion.trajectory, JOINTS, jerk=stream.jerk_limits)
    assert usage.velocity <= 0.5 * 1.01
    assert usage.acceleration <= 0.5 * 1.01
    assert usage.jerk <= 1.03
    assert motion.trajectory.positions[-1] == pytest.approx(path[-1], abs=1e-6)
    assert motion.trajectory.velocities[-1] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_chunk_that_would_be_twenty_times_slower_is_a_jump(stream: ChunkStream) -> None:
    """Steps of 45 mm at 0.45 m/s take 0.1 s."""
    path = going([0, 0], [0.045, 0.0])
    slow = stream.splice(path, DT / 19.0, 0.0, 0.0)
    assert slow.trajectory.duration > 0.9
    with pytest.raises(PolicyActionError, match="the chunk jumps"):
        stream.splice(path, DT / 21.0, 0.0, 0.0)


def test_the_motion_goes_over_into_the_next_chunk_with_its_speed_and_acceleration(stream: ChunkStream) -> None:
    stream.accept(stream.splice(going([0, 0], [0.02, 0.02]), DT, 0.0, 0.0), 0.0)
    before = stream.motion
    # Not asked for before it begins: until then the old motion goes on, and is told along with it.
    joined = stream.accept(stream.splice(going([0.06, 0.06], [0.02, -0.01]), DT, 0.3, 0.55), 0.4)
    assert joined.positions[0] == pytest.approx(before.state(0.4).positions)
    for time in (0.4, 0.45, 0.549):
        for name in ("positions", "velocities", "accelerations"):
            tolerance = 2e-2 if name == "accelerations" else 2e-4
            assert getattr(stream.motion.state(time), name) == pytest.approx(
                getattr(before.state(time), name), abs=tolerance
            )
    assert limit_usage(joined, JOINTS, jerk=stream.jerk_limits).within(0.5 * 1.03 / 0.5)
    assert not stream.moving(stream.motion.end)
    assert stream.moving(stream.motion.end - 0.01)
    assert np.array_equal(stream.motion.state(stream.motion.end + 1.0).accelerations, np.zeros(2))


def test_a_late_motion_is_taken_only_by_an_arm_at_rest_and_counts_from_then_on(stream: ChunkStream) -> None:
    first = stream.splice(going([0, 0], [0.02, 0.0]), DT, 0.0, 1.0)
    stream.accept(first, 3.0)
    assert (stream.motion.start, stream.motion.said) == (3.0, 3.0)
    assert stream.motion.state(3.0).positions == pytest.approx([0.0, 0.0])
    next_one = stream.splice(going([0.06, 0.0], [0.02, 0.0]), DT, 3.3, 3.5)
    with pytest.raises(StaleChunkError, match=r"should have begun 0\.100 s ago"):
        stream.accept(next_one, 3.6)
    # At rest again, what was seen long ago is no reason to refuse.
    end = stream.motion.end
    again = stream.splice(going([0.2, 0.0], [-0.02, 0.0]), DT, end + 1.0, end + 9.0)
    assert again.trajectory.positions[-1] == pytest.approx([0.0, 0.0], abs=1e-6)


def test_the_older_chunk_counts_until_it_was_over_or_the_blend_is(stream: ChunkStream) -> None:
    """The old chunk speaks until 3.0 s at most; from then on the new one alone."""
    stream.accept(stream.splice(going([0, 0], [0.01, 0.0], 20), DT, 1.0, 1.0), 1.0)
    aside = going([0.05, 0.1], [0.01, 0.0], 15)
    spliced = stream.splice(aside, DT, 1.5, 1.6)
    after = spliced.state(2.1).positions
    assert after[1] == pytest.approx(0.1, abs=2e-3)
    early = spliced.state(1.7).positions
    assert 0.0 < early[1] < 0.03


class Pushing(Policy):
    """Moves a by 0.02 and b by -0.01 in each 0.1 s, and notes what it sees; 3 of 4 actions are executed."""

    specification = PolicySpecification(("a", "b"), "joint_deltas", 4, 0.1, executed=3)

    def __init__(self) -> None:
        self.seen: list[Observation] = []

    def reset(self) -> None:
        self.seen.clear()

    def act(self, observation: Observation) -> ActionChunk:
        self.seen.append(observation)
        return ActionChunk(np.tile([0.02, -0.01], (4, 1)), 0.1, DELTAS)


def test_a_policy_is_tried_action_by_action_and_sees_how_fast_it_moves() -> None:
    policy = Pushing()
    tried = roll_out(policy, Slides(), LIMITS, np.array([0.1, 0.0]), at(0.16), chunks=3)
    assert tried.path[:, 0] == pytest.approx(0.1 + 0.02 * np.arange(10))
    assert [seen.joint_velocities.tolist() for seen in policy.seen] == [
        [0.0, 0.0],
        pytest.approx([0.2, -0.1]),
        pytest.approx([0.2, -0.1]),
    ]
    assert policy.seen[1].goal == pytest.approx(pose_vector(at(0.16)))
    assert tried.errors[:, 0] == pytest.approx([0.03, 0.0, 0.03], abs=1e-9)
    elsewhere = roll_out(policy, Slides(), LIMITS, np.array([0.1, 0.0]), at(0.16), at(1.0), chunks=1)
    assert elsewhere.errors[0, 0] == pytest.approx(0.87)


def test_a_goal_is_reached_only_where_place_and_turn_are_right_at_once() -> None:
    tried = Rollout(np.zeros((1, 2)), np.array([[0.005, 0.2], [0.02, 0.01]]))
    assert not tried.reached(0.01, 0.1)
    assert tried.reached(0.03, 0.1)
    assert tried.reached(0.01, 0.3)
