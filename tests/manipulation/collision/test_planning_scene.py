"""Scenes are plain values: changed copies, and hashes that tell any two apart."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.collision.coal_world import fingerprint
from bestman_bt.manipulation.collision.planning_scene import AttachedObject, PlanningScene, SceneObstacle, VoxelObstacle
from bestman_bt.messages import PlacedShape, Pose, Sphere

BALL = (PlacedShape(Sphere(0.1), Pose()),)
CUP, TABLE = SceneObstacle("cup", BALL), SceneObstacle("table", BALL)
SEEN = VoxelObstacle("occupied", Pose(), np.zeros((1, 3), dtype=np.int64), 0.02)
SCENE = PlanningScene({}, (CUP, TABLE), voxels=(SEEN,))


def test_an_obstacle_of_the_same_name_is_replaced_and_a_new_one_added() -> None:
    padded, can = SceneObstacle("cup", BALL, 0.01), SceneObstacle("can", BALL)
    assert SCENE.adding(padded, can).obstacles == (TABLE, padded, can)


def test_what_is_taken_out_is_neither_an_obstacle_nor_voxels() -> None:
    left = SCENE.without("cup", "occupied")
    assert left.obstacles == (TABLE,)
    assert left.voxels == ()
    assert SCENE.without("can").voxels == (SEEN,)


def test_what_is_in_the_hand_stands_nowhere_else() -> None:
    held = AttachedObject("cup", BALL, "tool", Pose(), frozenset())
    holding = SCENE.holding(held)
    assert holding.obstacles == (TABLE,)
    assert holding.attached is held
    assert holding.holding(None).attached is None
    assert holding.holding(None).obstacles == (TABLE,)


def test_pairs_are_allowed_one_after_the_other() -> None:
    both = SCENE.allowing(("cup", "table")).allowing(("finger", "cup"))
    assert both.allowed_pairs == {frozenset({"cup", "table"}), frozenset({"finger", "cup"})}


def test_the_order_of_sets_and_mappings_does_not_count() -> None:
    assert list({0, 8}) != list({8, 0})
    assert fingerprint({0, 8}) == fingerprint({8, 0})
    assert fingerprint({"a": 1, "b": 2.0}) == fingerprint({"b": 2.0, "a": 1})


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (("ab", "c"), ("a", "bc")),
        ((1, 2), [1, 2]),
        (1, 1.0),
        (True, 1),
        (None, "None"),
        (((1,), 2), (1, (2,))),
        ({"a": 1}, {"a": 2}),
        (np.zeros(4), np.zeros((2, 2))),
        (np.zeros(2), np.zeros(4, dtype=np.float32)),
        (np.array([1.0, 2.0]), np.array([2.0, 1.0])),
        (Sphere(0.1), Sphere(0.2)),
        (CUP, SceneObstacle("cup", BALL, 0.01)),
    ],
)
def test_values_that_differ_have_different_fingerprints(one: object, other: object) -> None:
    assert fingerprint(one) != fingerprint(other)
    assert len(fingerprint(one)) == 32


def test_what_has_no_plain_value_has_no_fingerprint() -> None:
    with pytest.raises(TypeError, match="no fingerprint for a object"):
        fingerprint([object()])
