"""IsOpen, and how far doors may be asked to open: limits that are no numbers, beliefs that are none, units."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from behaviours.furniture.articulation import find_articulation
from behaviours.skill import SkillFailure
from bestman_bt.engine import FAILURE, SUCCESS
from bestman_bt.runtime.robot_session import RobotSession, session
from tests.behaviours.at_the_table import tick, tree_of

DOOR, DRAWER = "fridge/upper_door", "drawer_chest/drawer_1"


@pytest.fixture(scope="module")
def furnished() -> Iterator[RobotSession]:
    with session(scene="kitchen_furnished", seed=1) as opened:
        yield opened


def asked(opened: RobotSession, believed: float, **limits: float) -> tuple[int, list[tuple[str, str]]]:
    """What IsOpen says of the door that is believed to be open by ``believed``, radians."""
    opened.skills.world.articulations[DOOR] = believed
    before = len(opened.skills.failures)
    ports = " ".join(f'{name}="{{{name}}}"' for name in limits)
    tree = opened.load(tree_of(f'<IsOpen articulation="{DOOR}" {ports}/>'))
    for name, value in limits.items():
        tree.blackboard.set(name, value)
    status = tick(tree)
    return status, [(failure.error_code, failure.why) for failure in opened.skills.failures[before:]]


@pytest.mark.slow
def test_the_limits_themselves_hold(furnished: RobotSession) -> None:
    assert asked(furnished, 0.5, at_least=0.5, at_most=0.5) == (SUCCESS, [])
    assert asked(furnished, 0.5, at_least=0.51) == (FAILURE, [("not_open", f"{DOOR} is open by 0.50 rad only")])
    assert asked(furnished, 0.5, at_most=0.49) == (FAILURE, [("not_closed", f"{DOOR} is open by 0.50 rad")])


@pytest.mark.parametrize(
    ("port", "message"),
    [
        ("at_least", "port 'at_least': nan is not accepted, but a finite number of 0 or more"),
        ("at_most", "port 'at_most': nan is not accepted, but a finite number of 0 or more"),
    ],
)
def test_a_limit_that_is_no_number_is_refused_whatever_is_believed(
    furnished: RobotSession, port: str, message: str
) -> None:
    for believed in (0.0, 0.5):
        assert asked(furnished, believed, **{port: math.nan}) == (FAILURE, [("bad_input", message)])


@pytest.mark.parametrize("port", ["at_least", "at_most"])
def test_a_door_that_is_open_by_no_number_is_neither_open_nor_shut(furnished: RobotSession, port: str) -> None:
    assert asked(furnished, math.nan, **{port: 0.1}) == (FAILURE, [("not_open", f"{DOOR} is open by nan rad only")])


@pytest.mark.parametrize(
    ("name", "beyond", "range_told"),
    [(DOOR, 2.5, "opens by 0 to 1.90 rad"), (DOOR, -0.01, "rad"), (DRAWER, 0.5, "opens by 0 to 0.33 m")],
)
def test_an_opening_out_of_range_is_refused_in_the_unit_of_the_joint(
    furnished: RobotSession, name: str, beyond: float, range_told: str
) -> None:
    door = find_articulation(furnished.skills, name)
    door.check_opening("opening", 0.0)
    door.check_opening("opening", door.articulation.upper)
    with pytest.raises(SkillFailure, match=range_told) as refused:
        door.check_opening("opening", beyond)
    assert refused.value.code == "bad_input"
    with pytest.raises(SkillFailure, match="opening is nan"):
        door.check_opening("opening", math.nan)
