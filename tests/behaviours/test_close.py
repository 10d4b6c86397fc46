"""Closing doors and drawers by pushing: what the skill says, and where the leaf really is."""

from __future__ import annotations

import math

import pytest

from bestman_bt.configuration import load_run
from tests.behaviours.truth import audited, known_world, succeeds

START = ("scene.robot_start.x=[-0.7, -0.65]", "scene.robot_start.y=[0.0, 0.05]", "scene.robot_start.yaw=[0.0, 0.05]")
CLOSE = (
    '<Sequence><FindCloseStand articulation="{articulation}" stand="{s}"/><MoveArm posture="carry"/>'
    '<NavigateTo goal="{s}"/><Close articulation="{articulation}" left="{left}"/></Sequence>'
)


def standing_open(task: str, leaf: str, position: str):
    furniture, _, part = leaf.partition("/")
    return known_world(
        load_run(task, seed=1, settings=(*START, f"scene.furniture.{furniture}.open={{{part}: {position}}}"))
    )


@pytest.mark.parametrize(
    ("task", "leaf", "written", "position"),
    [("open_drawer", "drawer_chest/drawer_3", "22 cm", 0.22), ("open_fridge", "fridge/upper_door", "80 deg", 1.40)],
)
def test_what_is_believed_to_stand_open_is_pushed_shut(task: str, leaf: str, written: str, position: float) -> None:
    with standing_open(task, leaf, written) as (session, truth):
        session.skills.world.articulations[leaf] = position + 0.01
        assert succeeds(session, CLOSE)
        assert truth.articulation_position(leaf) < (0.005 if position < 1.0 else math.radians(1.0))
        assert session.skills.world.articulations[leaf] == 0.0
        assert audited(session).honest
        touched = {body for contact in audited(session).collisions for body in (contact.first, contact.second)}
        assert touched <= {"panda_leftfinger", "panda_rightfinger", leaf.partition("/")[0]}
