"""What is tidy and what is not, where there is room, and what a task's goals say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.engine import FAILURE, SUCCESS, Tree
from bestman_bt.messages import Pose
from bestman_bt.runtime.robot_session import RobotSession
from bestman_bt.world_model.world_model import HeldObject
from hal.simulation.ground_truth import GroundTruth
from tests.behaviours.at_the_table import failures_of, tick, tree_of
from tests.behaviours.truth import known_world, succeeds, table_with

pytestmark = pytest.mark.slow

CUP, CAN = (-0.2, 0.15), (-0.15, -0.2)
"""Where they stand: x, y in the frame of the table's top, metres."""
WHERE = 'surface="table" region_x="{x}" region_y="{y}"'


@pytest.fixture(scope="module")
def table(tmp_path_factory) -> Iterator[tuple[RobotSession, GroundTruth]]:
    """A robot that has seen the cup and the can on the table before it."""
    config = table_with(tmp_path_factory.mktemp("scene"), cup=("cup", *CUP, 0.0), can=("can", *CAN, 0.0))
    with known_world(config) as (session, truth):
        assert succeeds(session, '<Sequence><LookAt surface="table"/><ScanScene surface="table"/></Sequence>')
        yield session, truth


def run(session: RobotSession, body: str, **entries: object) -> tuple[int, Tree]:
    """Status and tree, once it is done."""
    tree = session.load(tree_of(body))
    for name, value in entries.items():
        tree.blackboard.set(name, value)
    return tick(tree, 200), tree


def untidy(session: RobotSession, x: tuple[float, float], y: tuple[float, float]) -> list[str]:
    body = f'<FindUntidy seen="{{seen}}" {WHERE} untidy="{{untidy}}"/>'
    _, tree = run(session, body, seen=["cup", "can"], x=list(x), y=list(y))
    return tree.blackboard.get("untidy")


def test_what_was_seen_of_the_named_things_is_remembered_and_stays(table) -> None:
    body = '<RememberSeen objects="{objects}" seen="{seen}"/>'
    _, tree = run(table[0], body, objects=["can", "box", "bowl"], seen=["mug"])
    assert tree.blackboard.get("seen") == ["mug", "can"]


def test_things_outside_the_region_are_untidy(table) -> None:
    assert untidy(table[0], (-0.4, 0.0), (-0.5, 0.5)) == []
    assert untidy(table[0], (-0.4, 0.0), (0.0, 0.5)) == ["can"]
    assert untidy(table[0], (-0.4, -0.19), (-0.5, 0.5)) == ["cup", "can"]


def test_what_was_seen_once_and_is_lost_now_is_not_tidy(table) -> None:
    body = f'<IsTidy seen="{{seen}}" {WHERE}/>'
    status, _ = run(table[0], body, seen=["cup", "bowl"], x=[-0.4, 0.0], y=[-0.5, 0.5])
    assert status == FAILURE
    assert failures_of(table[0])[0] == ("untidy", "the bowl does not stand within the region on the table")


def test_where_nothing_was_seen_nothing_is_tidy(table) -> None:
    status, _ = run(table[0], f'<IsTidy seen="{{seen}}" {WHERE}/>', seen=[], x=[-0.4, 0.0], y=[-0.5, 0.5])
    assert status == FAILURE
    assert failures_of(table[0])[0][0] == "nothing_seen"


def test_a_free_place_is_clear_of_all_things_and_the_next_one_is_another(table) -> None:
    session, truth = table
    x, y = [-0.35, -0.05], [-0.45, 0.45]
    body = f"""<Sequence>
      <LookAt surface="table"/>
      <FindFreePlace object="cup" {WHERE} goal="{{goal}}"/>
    </Sequence>"""
    tree = session.load(tree_of(body))
    tree.blackboard.set("x", x)
    tree.blackboard.set("y", y)
    places: list[Pose] = []
    for _ in range(2):
        assert tick(tree, 200) == SUCCESS
        places.append(tree.blackboard.get("goal"))
    assert np.linalg.norm(places[1].position[:2] - places[0].position[:2]) > 0.08
    for place in places:
        for name, radius in (("cup", 0.033), ("can", 0.0265)):
            gap = np.linalg.norm(place.position[:2] - truth.object_pose(name).position[:2]) - radius - 0.033
            assert gap > 0.03
        furniture, surface = session.skills.world.map.surface("table")
        local = ((furniture.pose.to_pose() @ surface.pose).inverse() @ place).position
        assert x[0] <= local[0] <= x[1]
        assert y[0] <= local[1] <= y[1]


def test_without_a_region_any_free_place_on_the_surface_will_do(table) -> None:
    status, tree = run(table[0], '<FindFreePlace object="cup" surface="table" goal="{goal}"/>')
    assert status == SUCCESS
    goal = tree.blackboard.get("goal").position
    assert abs(goal[2] - table[1].object_pose("cup").position[2]) < 0.1
    assert np.linalg.norm(goal[:2] - table[1].object_pose("cup").position[:2]) > 0.1


def test_a_region_without_room_is_full(table) -> None:
    body = f'<FindFreePlace object="cup" {WHERE} goal="{{goal}}"/>'
    status, _ = run(table[0], body, x=[CUP[0] - 0.06, CUP[0] + 0.06], y=[CUP[1] - 0.06, CUP[1] + 0.06])
    assert status == FAILURE
    code, words = failures_of(table[0])[0]
    assert code == "surface_full"
    assert words.endswith("cm disc for the cup is left in the region of the table")


def test_a_goal_is_taken_apart(table) -> None:
    body = '<TakeGoal entry="{entry}" object="{o}" source="{s}" target="{t}" goal="{g}"/>'
    goal = Pose(np.array([1.0, 2.0, 0.8]))
    entry = {"object": "mug", "source": "counter", "target": "table", "goal": goal}
    status, tree = run(table[0], body, entry=entry)
    assert status == SUCCESS
    assert [tree.blackboard.get(key) for key in "ost"] == ["mug", "counter", "table"]
    assert tree.blackboard.get("g") is goal
    del entry["target"]
    assert run(table[0], body, entry=entry)[0] == FAILURE
    assert failures_of(table[0])[0] == (
        "bad_input", "a goal should have object, source, target, goal; target is missing",
    )  # fmt: skip


@pytest.mark.parametrize(("order", "turn", "status"), [(1, 20.0, FAILURE), (1, 5.0, SUCCESS), (2, 175.0, SUCCESS)])
def test_how_an_object_is_turned_counts_where_a_tolerance_is_given(table, order, turn, status) -> None:
    session, _ = table
    belief = session.skills.world.objects["cup"]
    turned = belief.pose @ Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, np.radians(turn)))
    session.skills.world.objects["cup"] = replace(belief, model=replace(belief.model, symmetry_order=order))
    body = '<ObjectAt object="cup" goal="{goal}" yaw_tolerance="0.17"/>'
    try:
        assert run(session, body, goal=turned)[0] == status
    finally:
        session.skills.world.objects["cup"] = belief


def test_a_hand_that_does_not_let_go_reports_it_and_keeps_the_object(table, monkeypatch) -> None:
    session, _ = table
    skills = session.skills
    held = HeldObject("can", skills.world.objects["cup"].model, Pose(), skills.gripper.width())
    monkeypatch.setitem(skills.world.hands, skills.arm_name, held)
    monkeypatch.setattr(skills.gripper, "release", lambda: skills.gripper.open(skills.gripper.width()))
    assert run(session, '<Release object="can"/>')[0] == FAILURE
    assert failures_of(session)[0][0] == "not_released"
    assert skills.held is held
    assert skills.gripper.width() < 0.01  # there is nothing between the fingers, which grip again
