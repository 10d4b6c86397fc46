"""What holds for each algorithm about an arm: kinematics, collision worlds, time parametrisations, base placements."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from bestman_bt.manipulation.base_placement import BasePlacements, PathPlacements, ReachingArm
from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.planning_scene import PlanningScene, SceneObstacle
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.motion_planning.checked_edges import dense_points
from bestman_bt.manipulation.trajectory.base import SpeedScale
from bestman_bt.manipulation.trajectory.toppra import Toppra
from bestman_bt.messages import Box, Cylinder, PlacedShape, Pose, Pose2D, Sphere
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.world_model.semantic_map import MapFurniture
from tests.manipulation.table_and_shelf import FINGERS, fixed_panda
from tests.properties.profile import examples
from tests.robot_models import joint_group_model

pytestmark = pytest.mark.slow

NONSENSE = st.sampled_from([math.nan, math.inf, -math.inf])
shares = st.lists(st.floats(0.03, 0.97), min_size=7, max_size=7).map(np.array)
seeds = st.integers(0, 2**32 - 1)


@cache
def panda():
    robot = fixed_panda()
    return robot.of(ArmModel)["arm"], DampedLeastSquares(robot), CoalCollisionModel(robot)


def within(share):
    arm = panda()[0]
    return arm.lower + share * (arm.upper - arm.lower)


def turned(pose, angle):
    return Pose.from_xyz_rpy(np.zeros(3), (0.0, 0.0, angle)) @ pose


@examples(40)
@given(shares, shares, st.floats(-1.0, 1.0), seeds)
def test_a_pose_of_the_arm_is_reached_within_the_limits_whichever_way_the_arm_faces(goal, reference, turn, seed):
    """The pose turned about the axis of the first joint, its quaternion with either sign."""
    arm, kinematics, _ = panda()
    q = within(goal)
    assume(arm.lower[0] + 0.03 < q[0] + turn < arm.upper[0] - 0.03)
    for target in (
        kinematics.tool_pose(q),
        turned(kinematics.tool_pose(q), turn),
        Pose(kinematics.tool_pose(q).position, -kinematics.tool_pose(q).quaternion),
    ):
        found = kinematics.solve(target, within(reference), np.random.default_rng(seed), count=3)
        assert found.found
        for solution in found.solutions:
            assert ((solution >= arm.lower) & (solution <= arm.upper)).all()
            reached = target.inverse() @ kinematics.tool_pose(solution)
            np.testing.assert_allclose(reached.position, 0.0, atol=1e-4)
            assert abs(reached.quaternion[3]) > 1.0 - 1e-7


@examples(40)
@given(shares, st.integers(0, 6), st.integers(0, 2), NONSENSE)
def test_kinematics_refuses_what_is_no_number(goal, joint, axis, value):
    _, kinematics, _ = panda()
    q, wrong = within(goal), within(goal)
    target = kinematics.tool_pose(q)
    wrong[joint] = value
    position = target.position.copy()
    position[axis] = value
    rng = np.random.default_rng(0)
    for ask in (
        lambda: kinematics.solve(Pose(position, target.quaternion), q, rng),
        lambda: kinematics.solve(target, wrong, rng),
        lambda: kinematics.track(Pose(position, target.quaternion), q),
        lambda: kinematics.track(target, wrong),
        lambda: kinematics.tool_pose(wrong),
        lambda: kinematics.jacobian(wrong),
        lambda: kinematics.manipulability(wrong),
    ):
        with pytest.raises(ManipulationError, match="should be finite"):
            ask()


@examples(40)
@given(shares, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), seeds)
def test_a_pose_anywhere_has_a_solution_that_reaches_it_or_none(reference, x, y, z, seed):
    _, kinematics, _ = panda()
    target = Pose.from_xyz_rpy((x, y, z), (x, y, z))
    found = kinematics.solve(target, within(reference), np.random.default_rng(seed), attempts=5)
    if found.found:
        reached = target.inverse() @ kinematics.tool_pose(found.best)
        np.testing.assert_allclose(reached.position, 0.0, atol=1e-4)
        assert abs(reached.quaternion[3]) > 1.0 - 1e-7
    else:
        shoulder, length = kinematics.reach
        away = float(np.linalg.norm(target.position - shoulder))
        assert away - length <= found.position_error <= away + length
        assert max(found.position_error, found.rotation_error) > kinematics.tolerance
        assert found.attempts == (0 if away > length else 5)


sizes = st.floats(0.01, 0.4)
solids = st.one_of(
    st.builds(Box, st.tuples(sizes, sizes, sizes)), st.builds(Cylinder, sizes, sizes), st.builds(Sphere, sizes)
)
places = st.builds(
    Pose.from_xyz_rpy,
    st.tuples(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9), st.floats(0.0, 1.2)),
    st.tuples(st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-3, 3)),
)
bodies = st.lists(st.builds(PlacedShape, solids, places), min_size=1, max_size=5)


def scene_of(shapes, padding=0.0):
    obstacles = tuple(SceneObstacle(f"body_{number}", (shape,), padding) for number, shape in enumerate(shapes))
    return PlanningScene(FINGERS, obstacles, padding=0.0, self_padding=0.0)


@examples(40)
@given(bodies, shares, seeds)
def test_the_order_and_the_grouping_of_obstacles_decide_nothing(shapes, share, seed):
    _, _, model = panda()
    q, mixed = within(share), [shapes[i] for i in np.random.default_rng(seed).permutation(len(shapes))]
    one = model.world(scene_of(shapes))
    other = model.world(scene_of(mixed))
    whole = PlanningScene(FINGERS, (SceneObstacle("all", tuple(shapes)),), padding=0.0, self_padding=0.0)
    grouped = model.world(whole)
    assert one.is_free(q) == other.is_free(q) == grouped.is_free(q) == (not one.colliding_pairs(q))
    assert one.distance(q) == pytest.approx(other.distance(q), abs=1e-5)
    assert one.distance(q) == pytest.approx(grouped.distance(q), abs=1e-5)


@examples(40)
@given(bodies, shares, st.floats(-1.5, 1.5))
def test_links_touch_the_same_obstacles_when_arm_and_world_are_turned_together(shapes, share, turn):
    """About the axis of the first joint; links that it does not carry left out, and contacts of less than 1 mm."""
    arm, _, model = panda()
    q = within(share)
    there = q.copy()
    there[0] += turn
    assume(arm.lower[0] < there[0] < arm.upper[0])

    def touched(bodies, positions, padding):
        pairs = model.world(scene_of(bodies, padding)).colliding_pairs(positions)
        return {pair for pair in pairs if "panda_link0" not in pair and any(name.startswith("body") for name in pair)}

    moved = [PlacedShape(placed.shape, turned(placed.pose, turn)) for placed in shapes]
    assert touched(shapes, q, 0.0) <= touched(moved, there, 0.001)
    assert touched(moved, there, 0.0) <= touched(shapes, q, 0.001)


@examples(40)
@given(bodies, shares, st.floats(0.0, 0.1), st.floats(0.0, 0.1))
def test_more_padding_frees_nothing_and_costs_that_much_clearance(shapes, share, one, other):
    _, _, model = panda()
    q = within(share)
    less, more = sorted((one, other))
    thin, thick = model.world(scene_of(shapes, less)), model.world(scene_of(shapes, more))
    assert thin.is_free(q) or not thick.is_free(q)
    assert thick.clearance(q) <= thin.clearance(q) + 1e-5
    assert thin.clearance(q) - thick.clearance(q) <= more - less + 1e-5
    assert thin.distance(q) == pytest.approx(thick.distance(q), abs=1e-5)


@examples(20)
@given(shares, st.integers(0, 6), NONSENSE)
def test_a_collision_world_refuses_what_is_no_number(share, joint, value):
    world = panda()[2].world(scene_of([]))
    q = within(share)
    q[joint] = value
    for ask in (world.is_free, world.colliding_pairs, world.distance, world.clearance, world.nearest_pair):
        with pytest.raises(ManipulationError, match="should be finite"):
            ask(q)


@examples(20)
@given(places, shares, st.sampled_from([math.nan, math.inf, 0.0, -0.1]), st.integers(0, 2))
def test_obstacles_without_extent_or_place_are_refused_by_name(place, share, value, axis):
    model = panda()[2]
    size = [0.1, 0.1, 0.1]
    size[axis] = value
    position = place.position.copy()
    position[axis] = math.nan
    for placed in (
        PlacedShape(Box(tuple(size)), place),
        PlacedShape(Cylinder(*size[:2] if axis < 2 else (value, value)), place),
        PlacedShape(Sphere(value), place),
        PlacedShape(Box((0.1, 0.1, 0.1)), Pose(position, place.quaternion)),
    ):
        with pytest.raises(ManipulationError, match="body_0"):
            model.world(scene_of([placed])).is_free(within(share))


small = st.floats(-1.0, 1.0)
waypoints = st.lists(st.tuples(small, small, small), min_size=2, max_size=6).map(np.array)
steps = st.sampled_from([0.0, 1e-9, 1e-7, 1e-5, 4e-5])


@examples(8)
@given(waypoints, st.permutations(range(3)), st.floats(0.1, 1.0), st.floats(0.1, 1.0), steps, seeds)
def test_a_timed_path_stays_within_the_limits_and_on_the_path_in_any_order_of_the_joints(
    path, order, speed, rate, step, seed
):
    """Reversals, waypoints that come twice and ones that are almost the same."""
    path = np.repeat(path, 2, axis=0)
    path[1::2] += step * np.random.default_rng(seed).choice([-1.0, 1.0], path[1::2].shape)
    path = np.clip(path, -1.0, 1.0)
    velocity, acceleration = np.array([0.5, 1.0, 3.0]), np.array([4.0, 1.0, 9.0])
    ways = (
        (range(3), path),
        (order, path[:, list(order)]),
        (range(3), path[::-1]),
        (range(3), np.array([*dense_points(path, 0.02)])),
    )
    durations = []
    for columns, way in ways:
        columns = list(columns)
        limits = joint_group_model(tuple("abc"), velocity=velocity[columns], acceleration=acceleration[columns])
        timed = Toppra().parametrize(way, limits, SpeedScale(speed, rate))
        durations.append(timed.duration)
        np.testing.assert_array_equal(timed.velocities[[0, -1]], 0.0)
        assert (np.diff(timed.times) > 0).all()
        if len(timed.times) == 1:
            continue
        np.testing.assert_allclose(timed.positions[[0, -1]], way[[0, -1]], atol=1e-6)
        assert (np.abs(timed.velocities) <= 1.01 * speed * velocity[columns] + 1e-9).all()
        changes = np.diff(timed.velocities, axis=0) / np.diff(timed.times)[:, None]
        assert (np.abs(changes) <= 1.05 * rate * acceleration[columns] + 1e-6).all()
        assert (np.abs(timed.positions) <= 1.01).all()
        on_path = np.array([*dense_points(way, 0.01)])
        assert max(np.linalg.norm(on_path - q, axis=1).min() for q in timed.positions) < 0.03
    np.testing.assert_allclose(durations, durations[0], rtol=0.15, atol=0.05)


@examples(8)
@given(waypoints, st.integers(0, 2), NONSENSE)
def test_a_path_that_is_no_path_is_not_timed(path, joint, value):
    limits = joint_group_model(tuple("abc"))
    wrong = path.copy()
    wrong[len(path) // 2, joint] = value
    with pytest.raises(ManipulationError, match="should be finite"):
        Toppra().parametrize(wrong, limits)
    wrong[len(path) // 2, joint] = 1.5
    with pytest.raises(ManipulationError, match="allowed -1"):
        Toppra().parametrize(wrong, limits)
    for empty in (path[:0], path[:, :2], path[0]):
        with pytest.raises(ManipulationError, match="should have shape"):
            Toppra().parametrize(empty, limits)


poses_2d = st.builds(Pose2D, st.floats(-20, 20), st.floats(-20, 20), st.floats(-3, 3))
TABLE = MapFurniture("table", Pose2D(0.9, 0.1, 0.3), (0.6, 1.0), 0.4, (), False)


@examples(40)
@given(poses_2d, st.floats(-1, 1), st.floats(-1, 1), st.sampled_from(["front", "back", "left", "right"]))
def test_stands_beside_furniture_are_the_same_wherever_the_world_lies(world, x, y, side):
    target = TABLE.pose.apply(np.array([x, y]))
    there = MapFurniture("table", world @ TABLE.pose, TABLE.footprint, TABLE.height, (), False)
    one = BasePlacements().beside(TABLE, target, 0.3, (side,))
    other = BasePlacements().beside(there, world.apply(target), 0.3, (side,))
    assert len(one) == len(other) > 0
    for stand, moved in zip(one, other, strict=True):
        assert (world @ stand).distance_to(moved) < 1e-6
        assert math.cos((world @ stand).theta - moved.theta) > 1.0 - 1e-9
    for wrong in ((math.nan, y), (x, math.inf)):
        with pytest.raises(ManipulationError, match="target should be finite"):
            BasePlacements().beside(TABLE, wrong, 0.3)


@pytest.mark.parametrize("planner", [BasePlacements(enough=100), PathPlacements(enough=100, most=100)])
@examples(6)
@given(poses_2d, shares, st.randoms(), st.booleans())
def test_placements_are_the_same_wherever_the_world_lies_and_in_any_order(planner, world, share, random, known):
    arm, kinematics, _ = panda()
    tool = kinematics.tool_pose(within(share * 0.5 + 0.25))
    nowhere = Pose(np.array([0.5, math.nan, 0.5]))
    stands = [Pose2D(x, y, turn) for x in (-0.2, 0.1) for y in (-0.3, 0.2) for turn in (-0.4, 0.5)]
    ways = [Pose(tool.position + np.array([0.0, 0.0, rise]), tool.quaternion) for rise in (0.1, 0.05, 0.0)]

    def ranked(candidates, frame):
        reaching = ReachingArm(kinematics, arm, within(np.full(7, 0.5)), np.random.default_rng(1))
        poses = [frame.to_pose() @ pose for pose in ways]
        asked = [poses] if isinstance(planner, BasePlacements) else [[pose] for pose in poses]
        current = frame @ Pose2D(0.5, 0.5, 0.0) if known else None
        return planner.rank([frame @ stand for stand in candidates], asked, reaching, current=current)

    with pytest.raises(ManipulationError, match="should be finite"):
        planner.rank(
            stands, [[nowhere]], ReachingArm(kinematics, arm, within(np.full(7, 0.5)), np.random.default_rng(1))
        )
    here, there, mixed = (
        ranked(candidates, frame)
        for candidates, frame in (
            (stands, Pose2D()),
            (stands, world),
            (random.sample(stands, len(stands)), Pose2D()),
        )
    )
    for frame, other in ((world, there), (Pose2D(), mixed)):
        # Searches for joint positions are random: one on the edge of reach may fail.
        found = [sum((frame @ a.pose).distance_to(b.pose) < 1e-6 for b in other) for a in here]
        assert len(here) == pytest.approx(len(other), abs=1)
        assert sum(count == 0 for count in found) <= 1
    for placement in there:
        first = placement.positions if isinstance(planner, BasePlacements) else placement.arc.path[0]
        reached = placement.pose.to_pose() @ kinematics.tool_pose(first)
        np.testing.assert_allclose(reached.position, (world.to_pose() @ ways[0]).position, atol=1e-3)
