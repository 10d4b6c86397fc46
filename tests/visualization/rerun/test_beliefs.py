"""What the robot believes is in the scene as long as it believes it."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose, YawSet
from bestman_bt.visualization.marks import GraspMark, ObjectMark

BOX = ObjectModel("box", (0.2, 0.3, 0.8), 0.3, 0.6, (PlacedShape(Box((0.1, 0.2, 0.3)), Pose()),), symmetry_order=2)


def mark(name: str, x: float) -> ObjectMark:
    return ObjectMark(name, BOX, Pose.from_xyz_rpy((x, 0.0, 0.5)), 0.9, 0.001, YawSet(), np.array([[x, 0.0, 0.5]]))


def test_the_map_is_drawn_for_good_with_closed_outlines(record, recorded):
    with record() as recorder:
        recorder.map(np.array([[0.0, 0.0, 4.0, 0.0]]), {"table": np.array([[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]])})
    ((wall, table),) = recorded().column("/world/map", "LineStrips3D:strips", static=True)
    assert [point[:2] for point in wall] == [[0.0, 0.0], [4.0, 0.0]]
    assert [point[:2] for point in table] == [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 1.0]]


def test_objects_move_with_the_belief_and_go_when_it_ends(record, recorded):
    with record() as recorder:
        recorder.objects([mark("cup", 1.0), mark("can", 2.0)], 1.0)
        recorder.objects([mark("can", 3.0)], 2.0)
    run = recorded()
    drawn = run.rows("/world/beliefs/can/box")
    assert [row["sim_time"] for row in drawn] == [1.0, 2.0]
    middles = [np.mean(row["LineStrips3D:strips"], axis=(0, 1))[0] for row in drawn]
    assert middles == pytest.approx([2.0, 3.0])
    for gone in ("/world/beliefs/cup", "/world/markers/cup"):
        assert [row["sim_time"] for row in run.rows(gone) if row.get("Clear:is_recursive")] == [2.0]
    colors = [run.column(f"/world/beliefs/{name}/box", "LineStrips3D:colors")[0] for name in ("cup", "can")]
    assert colors[0] != colors[1]


def test_grasps_are_hands_until_none_are_left(record, recorded):
    grasps = [GraspMark("cup", Pose.from_xyz_rpy((1.0, y, 0.5)), 0.08, 0.05, 1.0) for y in (0.0, 0.5, 1.0)]
    with record() as recorder:
        recorder.grasps(grasps, 1.0)
        recorder.grasps(grasps[1:], 2.0)
        recorder.grasps([], 3.0)
    run = recorded()
    strips = {row["sim_time"]: row["LineStrips3D:strips"] for row in run.rows("/world/grasps")}
    assert {stamp: len(lines) for stamp, lines in strips.items()} == {1.0: 12, 2.0: 8, 3.0: 0}
    best = strips[2.0][0]
    assert best == [pytest.approx([1.0, 0.46, 0.5]), pytest.approx([1.0, 0.46, 0.45])]


def test_a_path_that_is_done_is_removed(record, recorded):
    with record() as recorder:
        recorder.path("planned", None, 2.0)
    assert [row["LineStrips3D:strips"] for row in recorded().rows("/world/paths/planned")] == [[[]]]


def test_changes_of_the_blackboard_are_lines_of_text(record, recorded):
    with record() as recorder:
        recorder.blackboard("sub/object = cup", 1.5)
    assert [(row["sim_time"], row["TextLog:text"]) for row in recorded().rows("/blackboard")] == [
        (1.5, ["sub/object = cup"])
    ]
