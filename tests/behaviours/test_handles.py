"""Handles of generated furniture as the robot comes to believe in them, against the true ones."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from bestman_bt.configuration.run import RunRequest
from bestman_bt.messages import Handle
from bestman_bt.runtime.perception_preview import furniture_to_look_at, run_in_front_of
from bestman_bt.runtime.robot_session import RobotSession
from tests.behaviours.at_the_table import tick, tree_of
from tests.behaviours.truth import known_world, succeeds, why_not

pytestmark = pytest.mark.slow

SCENE, SEED = "kitchen_furnished", 3


@contextmanager
def standing_at(name: str) -> Iterator[tuple[RobotSession, dict[str, Handle]]]:
    """A robot before furniture, its arm out of the picture, and the true handles in the map frame, by articulation."""
    asked = RunRequest(scene=SCENE, robot="diff_panda", seed=SEED)
    furniture = furniture_to_look_at(asked)[name]
    with known_world(run_in_front_of(furniture, asked)) as (session, truth):
        placed = next(piece for piece in session.setup.world.furniture if piece.name == name)
        true = {a.name: a.handle.seen_from(truth.furniture_pose(name)) for a in placed.model.articulations}
        middle = furniture.pose.to_pose().apply(np.array([[-furniture.footprint[0] / 2, 0.0, 0.0]]))[0]
        look = f'<LookAt point="{middle[0]};{middle[1]};{np.mean([h.pose.position[2] for h in true.values()])}"/>'
        assert succeeds(session, f'<Sequence><MoveArm posture="look"/>{look}</Sequence>')
        yield session, true


@pytest.fixture(scope="module")
def at_chest() -> Iterator[tuple[RobotSession, dict[str, Handle]]]:
    with standing_at("drawer_chest") as there:
        yield there


@pytest.fixture(scope="module")
def at_microwave() -> Iterator[tuple[RobotSession, dict[str, Handle]]]:
    with standing_at("microwave") as there:
        yield there


def found(session: RobotSession, attributes: str) -> tuple[str, int]:
    """The handle that is chosen, and how many there were to choose from."""
    tree = session.load(tree_of(f'<DetectHandle {attributes} handle="{{handle}}" count="{{count}}"/>'))
    tick(tree, 100)
    return tree.blackboard.get("handle"), tree.blackboard.get("count")


def nearest(handle: Handle, true: dict[str, Handle]) -> tuple[str, float]:
    """Which true handle it is, and how far it is from that, metres."""
    apart = {name: float(np.linalg.norm(other.pose.position - handle.pose.position)) for name, other in true.items()}
    name = min(apart, key=lambda known: apart[known])
    return name, apart[name]


def test_all_handles_of_a_chest_are_found_where_they_are_and_none_besides(at_chest) -> None:
    session, true = at_chest
    _, count = found(session, 'furniture="drawer_chest"')
    believed = session.skills.world.handles
    assert count == len(believed) == len(true)
    matches = {name: nearest(belief.handle, true) for name, belief in believed.items()}
    assert {name for name, _ in matches.values()} == set(true)
    assert max(apart for _, apart in matches.values()) < 0.015
    for name, belief in believed.items():
        assert name.startswith("drawer_chest/handle_")
        assert belief.furniture == "drawer_chest"
        assert abs(belief.handle.axis @ true[matches[name][0]].axis) > np.cos(np.radians(3.0))


def test_handles_that_are_seen_again_keep_their_names(at_chest) -> None:
    session, true = at_chest
    found(session, "")
    before = {name: nearest(belief.handle, true)[0] for name, belief in session.skills.world.handles.items()}
    found(session, "")
    assert {name: nearest(b.handle, true)[0] for name, b in session.skills.world.handles.items()} == before


@pytest.mark.parametrize("drawer", range(3))
def test_of_several_handles_the_one_that_is_asked_for_is_chosen(at_chest, drawer: int) -> None:
    session, true = at_chest
    name, handle = sorted(true.items())[drawer]
    x, y, z = handle.pose.position + np.array([0.02, -0.02, 0.04])
    chosen, _ = found(session, f'near="{x};{y};{z}"')
    assert nearest(session.skills.world.handles[chosen].handle, true)[0] == name


def test_handles_of_other_furniture_are_not_chosen(at_chest) -> None:
    assert why_not(at_chest[0], '<DetectHandle furniture="fridge"/>')[0] == "handle_not_found"


def test_furniture_that_does_not_exist_is_refused_with_what_there_is(at_chest) -> None:
    code, words = why_not(at_chest[0], '<DetectHandle furniture="piano"/>')
    assert code == "unknown_furniture"
    assert "known: table, counter, fridge, drawer_chest" in words


def test_the_handle_of_furniture_on_furniture_belongs_to_the_upper_one(at_microwave) -> None:
    session, true = at_microwave
    chosen, count = found(session, 'joint="revolute"')
    assert (chosen, count) == ("microwave/handle_1", 1)
    handle = session.skills.world.handles[chosen].handle
    assert nearest(handle, true)[1] < 0.015
    (door,) = true.values()
    assert handle.hinge_side == door.hinge_side
    assert handle.opening_direction @ door.opening_direction > np.cos(np.radians(5.0))


def test_a_handle_of_another_kind_of_joint_is_not_chosen(at_microwave) -> None:
    code, words = why_not(at_microwave[0], '<DetectHandle furniture="microwave" joint="prismatic"/>')
    assert code == "handle_not_found"
    assert words == "no handle on the microwave: 1 handles in view, none of them as asked"


def test_where_there_is_no_handle_none_is_invented(at_microwave) -> None:
    session, _ = at_microwave
    assert succeeds(session, '<LookAt point="-2.3;1.6;0.9"/>')
    before = dict(session.skills.world.handles)
    code, words = why_not(session, '<DetectHandle furniture="counter"/>')
    assert code == "handle_not_found"
    assert "no handle on the counter: " in words
    assert set(session.skills.world.handles) <= {*before, "microwave/handle_1"}
