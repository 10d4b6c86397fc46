"""Identities over views of rendered tables: what was moved, removed, added, and what was only hidden."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.rendering import Color, render_view
from bestman_bt.messages import Box, Cylinder, ObjectModel, PlacedShape, Pose, YawSet
from bestman_bt.perception.tracking import GlobalNearestNeighbour, Presence, presence
from bestman_bt.perception.view import View
from bestman_bt.scene.object_file import read_object
from bestman_bt.world_model.world_model import ObjectBelief

CAN = ObjectModel("can", (0.8, 0.2, 0.2), 0.3, 0.6, (PlacedShape(Cylinder(0.033, 0.1), Pose()),), symmetry_order=0)
BOX = ObjectModel("box", (0.2, 0.3, 0.8), 0.3, 0.6, (PlacedShape(Box((0.06, 0.1, 0.12)), Pose()),), symmetry_order=2)
TOP = 0.75
CAMERA = Pose.from_matrix(
    [[0.0, -0.7071, 0.7071, -0.3], [-1.0, 0.0, 0.0, 0.0], [0.0, -0.7071, -0.7071, 1.6], [0.0, 0.0, 0.0, 1.0]]
)


def standing(model: ObjectModel, x: float, y: float, yaw: float = 0.0) -> Pose:
    return Pose.from_xyz_rpy((x, y, TOP + model.size[2] / 2), (0.0, 0.0, yaw))


def sighted(model: ObjectModel, x: float, y: float, stamp: float = 1.0, name: str = "") -> ObjectBelief:
    return ObjectBelief(name or model.name, model, standing(model, x, y), 0.95, 0.001, stamp, "table/top")


def table_with(*things: tuple[ObjectModel, Pose]) -> View:
    parts: list[tuple[PlacedShape, Color]] = [
        (PlacedShape(Box((0.8, 1.2, 0.04)), Pose.from_xyz_rpy((0.6, 0.0, TOP - 0.02))), (0.7, 0.6, 0.4))
    ]
    for model, pose in things:
        parts += [(PlacedShape(part.shape, pose @ part.pose), model.color) for part in model.collision]
    return render_view(parts, CAMERA, np.random.default_rng(1))


def update(beliefs: Sequence[ObjectBelief], sightings: Sequence[ObjectBelief], view: View, **options):
    return GlobalNearestNeighbour().update({belief.name: belief for belief in beliefs}, sightings, view, **options)


@pytest.fixture(scope="module")
def empty_table() -> View:
    return table_with()


def test_what_is_seen_first_is_added(empty_table) -> None:
    tracked = update([], [sighted(CAN, 0.5, 0.1)], empty_table)
    assert list(tracked.objects) == ["can"]
    assert [change.kind for change in tracked.changes] == ["added"]
    assert tracked.objects["can"].since == 1.0


def test_what_stands_where_it_stood_keeps_its_name_and_since_when(empty_table) -> None:
    first = update([], [sighted(CAN, 0.5, 0.1, stamp=1.0)], empty_table)
    again = update(list(first.objects.values()), [sighted(CAN, 0.504, 0.1, stamp=7.0)], empty_table)
    assert again.changes == ()
    assert (again.objects["can"].since, again.objects["can"].stamp) == (1.0, 7.0)


def test_two_of_a_kind_get_two_names_and_keep_them_in_any_order(empty_table) -> None:
    first = update([], [sighted(CAN, 0.5, 0.1), sighted(CAN, 0.5, -0.2)], empty_table)
    assert set(first.objects) == {"can", "can_2"}
    again = update(list(first.objects.values()), [sighted(CAN, 0.5, -0.2), sighted(CAN, 0.5, 0.1)], empty_table)
    assert again.identities == ("can_2", "can")
    assert again.changes == ()


@pytest.mark.parametrize("order", [1, -1])
def test_of_two_of_a_kind_in_line_the_one_that_was_carried_past_the_other_has_moved(empty_table, order: int) -> None:
    rng = np.random.default_rng(11)
    for _ in range(40):
        start, along = rng.uniform(0.4, 0.5, 2), rng.uniform(-0.1, 0.1, 2) + np.array([0.0, 0.25])
        noise = rng.normal(0.0, 0.002, (2, 2))
        before = [sighted(CAN, *start), sighted(CAN, *(start + along), name="can_2")]
        seen = [(start + along + noise[0]), (start + 2.2 * along + noise[1])][::order]
        tracked = update(before, [sighted(CAN, *place) for place in seen], empty_table)
        assert [(change.kind, change.name) for change in tracked.changes] == [("moved", "can")]


def test_an_object_that_stands_elsewhere_was_moved(empty_table) -> None:
    tracked = update([sighted(CAN, 0.5, 0.1)], [sighted(CAN, 0.6, -0.2, stamp=3.0)], empty_table)
    (change,) = tracked.changes
    assert (change.kind, change.name) == ("moved", "can")
    assert change.before is not None
    assert np.allclose(change.before.position[:2], [0.5, 0.1])
    assert tracked.objects["can"].since == 3.0


def test_drift_of_the_map_is_not_taken_for_motion(empty_table) -> None:
    drifted = update([sighted(CAN, 0.5, 0.1)], [sighted(CAN, 0.55, 0.1)], empty_table, drift=0.02)
    exact = update([sighted(CAN, 0.5, 0.1)], [sighted(CAN, 0.55, 0.1)], empty_table)
    assert (len(drifted.changes), len(exact.changes)) == (0, 1)


def test_an_object_is_removed_where_the_camera_looks_through_its_place(empty_table) -> None:
    tracked = update([sighted(CAN, 0.5, 0.1)], [], empty_table)
    assert [(change.kind, change.name) for change in tracked.changes] == [("removed", "can")]
    assert tracked.objects == {}


def test_what_a_hand_holds_is_neither_missed_where_it_stood_nor_recognised_in_another_one(empty_table) -> None:
    held = sighted(CAN, 0.5, 0.1)
    assert update([held], [], empty_table, taken=["can"]).changes == ()
    another = update([held], [sighted(CAN, 0.5, 0.1)], empty_table, taken=["can"])
    assert list(another.objects) == ["can_2"]
    assert [change.kind for change in another.changes] == ["added"]


def test_an_object_behind_another_one_is_kept() -> None:
    tall = ObjectModel("tall", (0.2, 0.7, 0.2), 1.0, 0.6, (PlacedShape(Box((0.05, 0.3, 0.4)), Pose()),))
    hidden = table_with((tall, standing(tall, 0.4, 0.0)))
    tracked = update([sighted(CAN, 0.5, 0.0)], [], hidden)
    assert list(tracked.objects) == ["can"]
    assert tracked.changes == ()


def test_an_object_outside_the_picture_is_kept(empty_table) -> None:
    assert list(update([sighted(CAN, 0.5, 3.0)], [], empty_table).objects) == ["can"]


def test_another_object_at_its_place_has_replaced_it() -> None:
    view = table_with((BOX, standing(BOX, 0.5, 0.1)))
    tracked = update([sighted(CAN, 0.5, 0.1)], [sighted(BOX, 0.5, 0.1)], view)
    assert {change.kind for change in tracked.changes} == {"added", "replaced"}
    assert list(tracked.objects) == ["box"]


def test_an_object_above_its_place_on_another_board_has_not_replaced_it() -> None:
    below = replace(sighted(CAN, 0.5, 0.1), pose=Pose.from_xyz_rpy((0.5, 0.1, TOP - 0.3)))
    tracked = update([below], [sighted(BOX, 0.5, 0.1, stamp=2.0)], table_with((BOX, standing(BOX, 0.5, 0.1))))
    assert set(tracked.objects) == {"can", "box"}
    assert {change.kind for change in tracked.changes} == {"added"}


@pytest.mark.parametrize(("apart", "kept"), [(-0.002, False), (0.002, True)])
def test_what_reaches_into_its_height_has_taken_its_place_and_what_ends_below_has_not(apart: float, kept: bool) -> None:
    heights = (CAN.size[2] + BOX.size[2]) / 2
    below = replace(sighted(CAN, 0.5, 0.1), pose=Pose.from_xyz_rpy((0.5, 0.1, TOP + BOX.size[2] / 2 - heights - apart)))
    tracked = update([below], [sighted(BOX, 0.5, 0.1, stamp=2.0)], table_with((BOX, standing(BOX, 0.5, 0.1))))
    assert ("can" in tracked.objects) is kept


def test_what_the_hand_holds_is_not_the_one_on_the_table(empty_table) -> None:
    tracked = update([], [sighted(CAN, 0.5, 0.1)], empty_table, taken=["can"])
    assert list(tracked.objects) == ["can_2"]


def test_a_thing_without_a_model_is_known_again_nearby_and_is_new_far_away(empty_table) -> None:
    thing = replace(sighted(BOX, 0.5, 0.1), name="thing", recognised=False)
    first = update([], [thing], empty_table)
    assert list(first.objects) == ["thing_1"]
    near = update(list(first.objects.values()), [replace(thing, pose=standing(BOX, 0.52, 0.1))], empty_table)
    assert near.identities == ("thing_1",)
    far = update(list(first.objects.values()), [replace(thing, pose=standing(BOX, 0.7, -0.3))], empty_table)
    assert far.identities == ("thing_2",)


def test_a_yaw_that_was_known_is_kept_until_the_object_moves(empty_table) -> None:
    mug = replace(CAN, name="mug", symmetry_order=1)
    known = replace(sighted(mug, 0.5, 0.1), pose=standing(mug, 0.5, 0.1, 0.3), yaw_set=YawSet(((0.3, 0.1),)))
    vague = replace(sighted(mug, 0.503, 0.1), pose=standing(mug, 0.503, 0.1, 0.9), yaw_set=YawSet(((0.5, 1.2),)))
    kept = update([known], [vague], empty_table).objects["mug"]
    assert kept.pose.yaw == pytest.approx(0.3)
    assert kept.pose.position[0] == pytest.approx(0.503, abs=1e-4)
    moved = update([known], [replace(vague, pose=standing(mug, 0.7, 0.1, 0.9))], empty_table).objects["mug"]
    assert moved.yaw_set.width == pytest.approx(2.4)


def test_a_turned_object_was_moved(empty_table) -> None:
    turned = replace(sighted(BOX, 0.5, 0.1), pose=standing(BOX, 0.5, 0.1, 0.8), yaw_set=YawSet(((0.8, 0.05),)))
    half_turn = replace(turned, pose=standing(BOX, 0.5, 0.1, np.pi), yaw_set=YawSet(((np.pi, 0.05),)))
    before = replace(sighted(BOX, 0.5, 0.1), yaw_set=YawSet(((0.0, 0.05),)))
    assert [change.kind for change in update([before], [turned], empty_table).changes] == ["moved"]
    assert update([before], [half_turn], empty_table).changes == ()


def test_presence_of_an_object_that_is_there_is_possible() -> None:
    pose = standing(CAN, 0.5, 0.1)
    assert presence(CAN, pose, table_with((CAN, pose))) is Presence.POSSIBLE


def moved_by(distance: float, view: View, std: float = 0.001, **options: float) -> bool:
    before, after = (replace(sighted(CAN, x, 0.1), position_std=std) for x in (0.5, 0.5 + distance))
    return bool(update([before], [after], view, **options).changes)


def test_an_object_counts_as_moved_from_three_centimetres_or_three_deviations_on(empty_table) -> None:
    assert [moved_by(distance, empty_table) for distance in (0.029, 0.031)] == [False, True]
    three = 3.0 * 0.02 * np.sqrt(2.0)
    assert [moved_by(three + x, empty_table, std=0.02) for x in (-0.001, 0.001)] == [False, True]
    drifting = 3.0 * np.sqrt(2 * 0.001**2 + 2 * 0.02**2)
    assert [moved_by(drifting + x, empty_table, drift=0.02) for x in (-0.001, 0.001)] == [False, True]


@pytest.mark.parametrize(("degrees", "moved"), [(24.0, 0), (26.0, 1), (154.0, 1), (156.0, 0), (-24.0, 0), (-26.0, 1)])
def test_a_turn_counts_beyond_both_errors_modulo_the_symmetry(empty_table, degrees: float, moved: int) -> None:
    """Each yaw is known to five degrees: 35 degrees apart, 25 remain; half a turn looks the same."""
    five, middle = np.radians(5.0), np.radians(degrees + np.sign(degrees) * 10.0 * (1 if abs(degrees) < 90 else -1))
    before = replace(sighted(BOX, 0.5, 0.1), yaw_set=YawSet(((0.0, five),)))
    after = replace(sighted(BOX, 0.5, 0.1), pose=standing(BOX, 0.5, 0.1, middle), yaw_set=YawSet(((middle, five),)))
    assert len(update([before], [after], empty_table).changes) == moved


def test_sightings_are_assigned_all_at_once_at_the_least_total_distance(empty_table) -> None:
    """The nearest pair of all would leave the other two far from each other."""
    beliefs = [sighted(CAN, 0.50, 0.0, name="can"), sighted(CAN, 0.60, 0.0, name="can_2")]
    tracked = update(beliefs, [sighted(CAN, 0.555, 0.0), sighted(CAN, 0.655, 0.0)], empty_table)
    assert tracked.identities == ("can", "can_2")


def test_a_thing_is_no_known_object_and_another_label_or_size_is_another_thing(empty_table) -> None:
    thing = replace(sighted(BOX, 0.5, 0.1), name="thing", recognised=False)
    known = update([sighted(BOX, 0.5, 0.1)], [thing], empty_table)
    assert known.identities == ("thing_1",)
    before = replace(thing, name="thing_1")
    longer = replace(BOX, collision=(PlacedShape(Box((0.06, 0.1, 0.21)), Pose()),))
    labelled = replace(BOX, name="parcel")
    for model, identity in ((longer, "thing_2"), (labelled, "thing_2")):
        tracked = update([before], [replace(thing, model=model)], empty_table)
        assert tracked.identities == (identity,)


@pytest.mark.parametrize(("aside", "kind"), [(0.039, "replaced"), (0.041, "removed")])
def test_what_stands_within_four_centimetres_has_taken_the_place(empty_table, aside: float, kind: str) -> None:
    tracked = update([sighted(CAN, 0.5, 0.1)], [sighted(BOX, 0.5, 0.1 + aside)], empty_table)
    assert {change.kind for change in tracked.changes} == {"added", kind}
    gone = next(change for change in tracked.changes if change.kind == kind)
    assert (gone.name, gone.before.position[1]) == ("can", 0.1)


@pytest.mark.parametrize("yaw", [0.3, 2.5, -1.7])
def test_with_the_yaw_that_was_known_the_body_stays_where_it_is_seen(empty_table, yaw) -> None:
    """The axis of the mug's body is 15 mm beside the origin; a view that hides the handle may take any yaw."""
    mug, axis, known_yaw = read_object("mug"), np.array([-0.015, 0.0, 0.0]), 0.3
    known = replace(sighted(mug, 0.5, 0.1), pose=standing(mug, 0.5, 0.1, known_yaw), yaw_set=YawSet(((0.3, 0.1),)))
    seen = known.pose.apply(axis) + np.array([0.002, 0.001, 0.0])
    origin = seen - standing(mug, 0.0, 0.0, yaw).rotation @ axis
    vague = replace(known, pose=standing(mug, *origin[:2], yaw), yaw_set=YawSet(((0.3, np.pi),)))
    tracked = update([known], [vague], empty_table)
    kept = tracked.objects["mug"].pose
    assert kept.yaw == pytest.approx(known_yaw)
    assert not tracked.changes
    np.testing.assert_allclose(kept.apply(axis)[:2], seen[:2], atol=0.0015)


def test_a_yaw_is_kept_with_its_arcs_until_it_is_known_as_well_again(empty_table) -> None:
    mug = replace(CAN, name="mug", symmetry_order=1)
    known = replace(sighted(mug, 0.5, 0.1), pose=standing(mug, 0.5, 0.1, 0.3), yaw_set=YawSet(((0.3, 0.1),)))
    better = replace(sighted(mug, 0.5, 0.1), pose=standing(mug, 0.5, 0.1, 0.35), yaw_set=YawSet(((0.35, 0.05),)))
    vague = replace(sighted(mug, 0.5, 0.1), pose=standing(mug, 0.5, 0.1, 0.9), yaw_set=YawSet(((0.5, 1.2),)))
    assert update([known], [better], empty_table).objects["mug"].yaw_set == better.yaw_set
    assert update([known], [vague], empty_table).objects["mug"].yaw_set == known.yaw_set


@pytest.mark.parametrize(
    ("behind", "state"), [(0.0, Presence.POSSIBLE), (0.03, Presence.GONE), (-0.1, Presence.HIDDEN)]
)
def test_presence_is_told_from_depth_beyond_the_margin(behind: float, state: Presence) -> None:
    """The whole picture shows a wall at, behind or before the front of a thin board."""
    board = ObjectModel("board", (1, 1, 1), 0.3, 0.6, (PlacedShape(Box((0.002, 0.1, 0.1)), Pose()),))
    ahead = Pose.from_matrix([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
    wall = PlacedShape(Box((0.02, 3.0, 3.0)), Pose(np.array([1.009 + behind, 0.0, 0.0])))
    seen = render_view([(wall, (0.5, 0.5, 0.5))], ahead, np.random.default_rng(0))
    assert presence(board, Pose(np.array([1.0, 0.0, 0.0])), seen) is state


@pytest.mark.parametrize(("open_from", "state"), [(-0.01, Presence.GONE), (0.01, Presence.POSSIBLE)])
def test_what_is_looked_through_by_less_than_half_may_be_there(open_from: float, state: Presence) -> None:
    """A thin board of 10 cm, and a wall: at its front up to ``open_from`` on its left, and far behind beside that."""
    board = ObjectModel("board", (1, 1, 1), 0.3, 0.6, (PlacedShape(Box((0.002, 0.1, 0.1)), Pose()),))
    ahead = Pose.from_matrix([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
    near = PlacedShape(Box((0.02, 1.0, 3.0)), Pose(np.array([1.009, open_from - 0.5, 0.0])))
    far = PlacedShape(Box((0.02, 3.0, 3.0)), Pose(np.array([1.3, 0.0, 0.0])))
    seen = render_view([(near, (0.5, 0.5, 0.5)), (far, (0.5, 0.5, 0.5))], ahead, np.random.default_rng(0))
    assert presence(board, Pose(np.array([1.0, 0.0, 0.0])), seen) is state
