from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from bestman_bt.facts.standing import is_over, rest_faults, surface_pose, tilt_fault
from bestman_bt.messages import Pose
from tests.facts.scripted import ScriptedEnd


@pytest.mark.parametrize(
    ("moved", "held", "on", "faults"),
    [
        (0.0, False, "table", []),
        (0.0, True, "table", ["not let go"]),
        (0.0009, False, "table", []),
        (-0.0009, False, "table", []),
        (0.0011, False, "table", ["still moving"]),
        (-0.0011, False, "table", ["still moving"]),
        (0.0, False, "chest", ["not standing on the table"]),
        (0.01, True, "chest", ["still moving", "not let go", "not standing on the table"]),
    ],
)
def test_an_object_rests_where_it_lies_still_on_the_furniture_and_no_hand_touches_it(moved, held, on, faults) -> None:
    truth = SimpleNamespace(
        object_pose=lambda name: Pose([moved, 0.0, 0.8]),
        touches_robot=lambda name: held,
        supports=lambda name: (on,),
    )
    evidence = SimpleNamespace(truth=truth, before={"cup": (0.0, 0.0, 0.8)})
    assert rest_faults(evidence, "cup", "table/top") == faults


TURNED = "scene.furniture.drawer_chest.at=[1.4, 0.3, 115 deg]"


@pytest.fixture(scope="module")
def chest() -> ScriptedEnd:
    """A chest of drawers that stands askew in the room, two of its drawers open."""
    end = ScriptedEnd("put_away", TURNED)
    end.truth.opened = {"drawer_chest/drawer_3": 0.25, "drawer_chest/drawer_1": 0.1}
    return end


@pytest.mark.parametrize(
    ("surface", "opened"), [("drawer_3", 0.25), ("drawer_2", 0.0), ("drawer_1", 0.1), ("top", 0.0)]
)
def test_a_surface_is_where_its_drawer_is_and_goes_as_far_up_as_the_next_one(
    chest: ScriptedEnd, surface: str, opened: float
) -> None:
    name = f"drawer_chest/{surface}"
    piece, pose, size, room = surface_pose(chest.evidence(), name)
    shut = chest.surface(name)
    door = piece.model.drawer_of(surface)
    way = pose.position - shut.position
    assert np.linalg.norm(way) == pytest.approx(opened, abs=1e-9)
    if door is not None:
        np.testing.assert_allclose(way, opened * piece.pose.rotation @ np.array(door.axis), atol=1e-9)
        out = piece.pose.rotation[:, 0]  # the front of a piece looks against its x axis
        assert way @ out == pytest.approx(-opened)
    above = sorted(
        float(other.pose.position[2] - (piece.pose.inverse() @ shut).position[2])
        for other in piece.model.all_surfaces
        if other.pose.position[2] > (piece.pose.inverse() @ shut).position[2] + 1e-6
    )
    assert room == pytest.approx(above[0] if above else math.inf)
    half = np.array(size) / 2
    middle = min(room, 0.1) / 2
    for x, y, z, over in (
        (0.0, 0.0, middle, True),
        (0.999, 0.999, middle, True),
        (-0.999, -0.999, middle, True),
        (1.001, 0.0, middle, False),
        (0.0, -1.001, middle, False),
        (0.0, 0.0, -0.001, False),
        (0.0, 0.0, 0.001, True),
        (0.0, 0.0, room - 0.001, True),
        (0.0, 0.0, room + 0.001, not above),
    ):
        z = min(z, 5.0)
        chest.put("cup", pose @ Pose(np.array([x * half[0], y * half[1], z])))
        assert is_over(chest.evidence(), "cup", name) is over, (x, y, z)


@pytest.mark.parametrize("share", [0.99, 1.01])
@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_a_tilt_in_any_direction_is_held_to_the_tolerance(chest: ScriptedEnd, share: float, heading: float) -> None:
    tilt = share * chest.setup.config.task.tolerances.tilt
    pose = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, heading)) @ Pose.from_xyz_rpy(
        (0.0, 0.0, 0.0), (0.0, tilt, 0.0)
    )
    assert tilt_fault(chest.evidence(), pose) == ([] if share < 1.0 else ["tilted by 10°"])
