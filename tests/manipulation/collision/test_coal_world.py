from __future__ import annotations

import math
from dataclasses import replace

import coal
import numpy as np
import pytest

from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.planning_scene import AttachedObject, PlanningScene, SceneObstacle
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.messages import Box, Cylinder, Mesh, PlacedShape, Pose, Sphere
from tests.manipulation.table_and_shelf import FINGERS, table_and_shelf


def obstacle(name: str, shape, position, padding: float = 0.0) -> SceneObstacle:
    return SceneObstacle(name, (PlacedShape(shape, Pose(np.asarray(position, dtype=float))),), padding)


@pytest.fixture
def tip(kinematics, ready):
    return kinematics.tool_pose(ready).position


def test_what_counts_as_free_is_free_for_pybullet(world, arm, referee, rng):
    free = [q for q in rng.uniform(arm.lower, arm.upper, (400, 7)) if world.is_free(q)]
    assert 150 < len(free) < 350
    assert max(referee.depth(q) for q in free) < 1e-4


def test_what_counts_as_colliding_is_near_something_for_pybullet(collision_model, arm, referee, rng):
    world = collision_model.world(table_and_shelf(padding=0.0))
    colliding = [q for q in rng.uniform(arm.lower, arm.upper, (400, 7)) if not world.is_free(q)]
    overlapping = [q for q in colliding if referee.depth(q) > 0.0]
    assert len(colliding) > 50
    assert len(overlapping) >= 0.95 * len(colliding)


def test_an_overlap_of_link_5_and_hand_is_found(collision_model, referee):
    """Here coal's GJK, asked with a margin of exactly zero, calls an overlap of 9 mm free."""
    rng = np.random.default_rng(0)
    lower = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
    upper = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
    q = rng.uniform(lower, upper, (135, 7))[134]
    world = collision_model.world(PlanningScene(FINGERS, self_padding=0.0))
    assert referee.depth(q) > 0.005
    assert not world.is_free(q)
    assert ("panda_hand", "panda_link5") in world.colliding_pairs(q)


def test_the_hull_of_a_link_holds_all_its_vertices(panda):
    """A mesh taken for its own hull gives false clearance where it is concave."""
    import pinocchio

    model = pinocchio.buildModelFromXML(panda.urdf)
    meshes = pinocchio.buildGeomFromUrdfString(model, panda.urdf, pinocchio.GeometryType.COLLISION)
    hulls = CoalCollisionModel(panda).geometry
    probe = coal.Sphere(1e-4)
    for mesh, hull in zip(meshes.geometryObjects, hulls.geometryObjects, strict=True):
        for vertex in mesh.geometry.vertices()[::7]:
            result = coal.DistanceResult()
            where = coal.Transform3s(np.eye(3), np.asarray(vertex))
            nearest = coal.distance(
                hull.geometry, coal.Transform3s.Identity(), probe, where, coal.DistanceRequest(), result
            )
            assert nearest < 1e-5, mesh.name


def test_an_obstacle_mesh_counts_as_its_hull(collision_model, tip, ready):
    """A cup-like mesh around the fingers, open above: the hand is inside its hull."""
    half, vertices, faces = 0.2, [], []
    for sign in (-1, 1):
        start = len(vertices)
        vertices += [(sign * half, y, z) for y in (-half, half) for z in (-half, half)]
        faces += [(start, start + 1, start + 2), (start + 1, start + 2, start + 3)]
    mesh = Mesh(np.array(vertices, dtype=float), np.array(faces))
    world = collision_model.world(PlanningScene(FINGERS, (obstacle("mesh", mesh, tip),)))
    assert ("mesh", "panda_leftfinger") in world.colliding_pairs(ready)


@pytest.mark.parametrize("shape", [Box((0.04, 0.04, 0.04)), Cylinder(0.02, 0.04), Sphere(0.02)])
def test_every_shape_collides_where_it_is_and_not_beside(collision_model, tip, ready, shape):
    touching = collision_model.world(PlanningScene(FINGERS, (obstacle("thing", shape, np.add(tip, [0, 0.03, 0])),)))
    beside = collision_model.world(PlanningScene(FINGERS, (obstacle("thing", shape, np.add(tip, [0, 0.2, 0])),)))
    assert not touching.is_free(ready)
    assert all("thing" in pair for pair in touching.colliding_pairs(ready))
    assert beside.is_free(ready)
    assert beside.colliding_pairs(ready) == ()


def test_padding_is_kept_and_not_part_of_the_distance(collision_model, tip, ready):
    scene = PlanningScene(FINGERS, (obstacle("plate", Box((0.5, 0.5, 0.01)), np.subtract(tip, [0, 0, 0.04])),))
    distance = collision_model.world(scene).distance(ready)
    assert 0.005 < distance < 0.05
    assert collision_model.world(replace(scene, padding=distance - 1e-4)).is_free(ready)
    assert not collision_model.world(replace(scene, padding=distance + 1e-4)).is_free(ready)
    padded = SceneObstacle("plate", scene.obstacles[0].shapes, padding=distance)
    wider = collision_model.world(scene.adding(padded))
    assert not wider.is_free(ready)
    assert wider.distance(ready) == pytest.approx(distance, abs=1e-6)


def test_an_overlap_has_a_negative_distance(collision_model, tip, ready):
    scene = PlanningScene(FINGERS, (obstacle("plate", Box((0.5, 0.5, 0.05)), tip),))
    assert collision_model.world(scene).distance(ready) < -0.01


def test_allowed_pairs_may_touch_and_no_others(collision_model, tip, ready):
    scene = PlanningScene(FINGERS, (obstacle("cup", Box((0.02, 0.09, 0.02)), tip),))
    pairs = collision_model.world(scene).colliding_pairs(ready)
    assert pairs == (("cup", "panda_leftfinger"), ("cup", "panda_rightfinger"))
    assert not collision_model.world(scene.allowing(pairs[0])).is_free(ready)
    assert collision_model.world(scene.allowing(*pairs)).is_free(ready)


def test_a_held_object_moves_with_the_hand_and_collides_for_it(collision_model, tip, ready):
    table = obstacle("table", Box((0.5, 0.5, 0.02)), np.subtract(tip, [0, 0, 0.13]))
    long = AttachedObject(
        "rod",
        (PlacedShape(Cylinder(0.01, 0.3), Pose()),),
        "panda_grasptarget",
        Pose(),
        frozenset({"panda_hand", "panda_leftfinger", "panda_rightfinger"}),
    )
    scene = PlanningScene(FINGERS, (table,))
    assert collision_model.world(scene).is_free(ready)
    assert collision_model.world(scene.holding(long)).colliding_pairs(ready) == (("rod", "table"),)
    assert collision_model.world(scene.holding(long).allowing(("rod", "table"))).is_free(ready)
    turned = ready.copy()
    turned[0] += 1.5
    assert collision_model.world(scene.holding(long)).is_free(turned)


def test_a_held_object_may_be_touched_by_the_listed_links_only(collision_model, ready):
    def held(*links: str) -> AttachedObject:
        shape = PlacedShape(Box((0.02, 0.09, 0.02)), Pose())
        return AttachedObject("block", (shape,), "panda_grasptarget", Pose(), frozenset(links))

    fingers = ("panda_leftfinger", "panda_rightfinger")
    scene = PlanningScene(FINGERS)
    assert collision_model.world(scene.holding(held(*fingers))).is_free(ready)
    touching = collision_model.world(scene.holding(held("panda_leftfinger")))
    # Locked fingers move with the hand as the object does: they cannot come nearer, and are not asked.
    assert touching.is_free(ready)
    behind = AttachedObject(
        "plank",
        (PlacedShape(Box((0.02, 0.02, 1.0)), Pose(np.array([0.0, 0.0, -0.5]))),),
        "panda_grasptarget",
        Pose(),
        frozenset(fingers),
    )
    assert not collision_model.world(scene.holding(behind)).is_free(ready)


def test_the_state_of_other_joints_counts(collision_model, tip, ready):
    plate = obstacle("plate", Box((0.01, 0.02, 0.02)), np.add(tip, [0, 0.048, 0]))
    closed = {joint: 0.0 for joint in FINGERS}
    assert not collision_model.world(PlanningScene(FINGERS, (plate,))).is_free(ready)
    assert collision_model.world(PlanningScene(closed, (plate,))).is_free(ready)


def test_answers_are_python_booleans_and_bad_positions_are_refused(world, ready):
    assert type(world.is_free(ready)) is bool
    assert type(world.is_free(list(ready))) is bool
    with pytest.raises(ManipulationError, match=r"7 joint positions .* \(6,\)"):
        world.is_free(ready[:6])
    with pytest.raises(ManipulationError, match="finite"):
        world.is_free(np.where(np.arange(7) == 3, math.nan, ready))


def test_bad_scenes_are_refused_by_name(collision_model):
    twice = (obstacle("cup", Sphere(0.1), (1, 0, 0)), obstacle("cup", Sphere(0.1), (1, 0, 1)))
    with pytest.raises(ManipulationError, match="two bodies named 'cup'"):
        collision_model.world(PlanningScene(FINGERS, twice))
    with pytest.raises(ManipulationError, match="shape of 'cup' should have positive finite sizes"):
        collision_model.world(PlanningScene(FINGERS, (obstacle("cup", Sphere(0.0), (1, 0, 0)),)))
    with pytest.raises(ManipulationError, match="no movable joint 'knee'"):
        collision_model.world(PlanningScene({"knee": 0.0}))
    with pytest.raises(ManipulationError, match="no arm 'left'"):
        collision_model.world(PlanningScene(FINGERS), "left")
