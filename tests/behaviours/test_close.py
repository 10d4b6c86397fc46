"""Closing doors and drawers by pushing: what the skill says, and where the door really is."""

from __future__ import annotations

import math

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.engine import RUNNING
from bestman_bt.messages import Pose2D
from bestman_bt.runtime.robot_session import open_session
from tests.behaviours.scripted import DeclaredContacts
from tests.behaviours.truth import audited, known_world, succeeds, why_not

pytestmark = pytest.mark.slow

DRAWER, DOOR = "drawer_chest/drawer_3", "fridge/upper_door"
LOOK = (
    '<FindLookStand articulation="{articulation}" stand="{s}" front="{front}"/><LookAt point="{front}"/>'
    '<DetectHandle articulation="{articulation}" near="{front}"/>'
)
CLOSE = f'<Sequence>{LOOK}<Close articulation="{{articulation}}" left="{{left}}"/></Sequence>'


def standing_open(task: str, door: str, written: str, stand: tuple[float, float, float], *more: str):
    """A robot at ``stand`` (x, y, degrees) before furniture of which one door is open."""
    furniture, _, part = door.partition("/")
    at = [f"scene.robot_start.{axis}=[{value}, {value}]" for axis, value in zip(("x", "y"), stand, strict=False)]
    turn = f"scene.robot_start.yaw=[{math.radians(stand[2])}, {math.radians(stand[2])}]"
    opened = f"scene.furniture.{furniture}.open={{{part}: {written}}}"
    return known_world(load_run(task, seed=1, settings=(*at, turn, opened, "scene.start_clearance=20 cm", *more)))


@pytest.mark.parametrize(
    ("task", "door", "written", "position", "stand"),
    [
        ("open_drawer", DRAWER, "22 cm", 0.22, (0.36, 0.33, -16.0)),
        ("open_fridge", DOOR, "55 deg", 0.96, (0.52, -0.53, 44.0)),
    ],
)
def test_what_is_believed_to_stand_open_is_pushed_shut_by_the_fingers_alone(
    task: str, door: str, written: str, position: float, stand: tuple[float, float, float]
) -> None:
    with standing_open(task, door, written, stand) as (session, truth):
        session.skills.world.articulations[door] = position
        session.skills.contacts = contacts = DeclaredContacts()
        assert succeeds(session, CLOSE)
        (declared,) = contacts.declared
        assert (declared.thing, declared.max_force) == (door, 140.0)
        pressed = [c.peak_force for c in session.robot.audit_record().contacts if c.articulation == door]
        assert 10.0 < max(pressed) < 90.0  # at its end stop, too
        assert truth.articulation_position(door) < 0.005
        assert session.skills.world.articulations[door] == 0.0
        assert audited(session).honest
        touched = {body for contact in audited(session).collisions for body in (contact.first, contact.second)}
        assert touched <= {"panda_leftfinger", "panda_rightfinger", door.partition("/")[0]}


def test_a_drawer_that_jams_on_its_way_is_reported_with_how_far_it_is_open() -> None:
    with standing_open("open_drawer", DRAWER, "22 cm", (0.36, 0.33, -16.0)) as (session, truth):
        session.skills.world.articulations[DRAWER] = 0.30  # the front is felt earlier
        simulation = session.robot.simulation
        body, joint = simulation.built.articulations[DRAWER]
        simulation.engine.client.changeDynamics(body, joint, jointLowerLimit=0.12, jointUpperLimit=0.3)
        code, words = why_not(session, CLOSE)
        assert code == "jammed", words
        left = truth.articulation_position(DRAWER)
        assert left == pytest.approx(0.12, abs=0.01)
        assert session.skills.world.articulations[DRAWER] == pytest.approx(left, abs=0.04)


def test_a_drawer_that_jams_just_before_it_is_shut_is_seen_to_be_open() -> None:
    with standing_open("open_drawer", DRAWER, "4 cm", (-0.2, 0.0, 0.0)) as (session, truth):
        simulation, world = session.robot.simulation, session.skills.world
        body, joint = simulation.built.articulations[DRAWER]
        world.articulations[DRAWER] = 0.0  # as it was felt
        is_shut = '<IsOpen articulation="{articulation}" at_most="0.01"/>'
        look = f'<Sequence><MoveArm posture="look"/>{LOOK}{is_shut}</Sequence>'
        assert why_not(session, look)[0] == "not_closed"
        assert world.articulations[DRAWER] == pytest.approx(truth.articulation_position(DRAWER), abs=0.01)
        simulation.engine.set_joint(body, joint, 0.0)
        assert succeeds(session, look)


def test_a_drawer_that_is_not_where_it_is_believed_to_be_is_reported() -> None:
    with standing_open("open_drawer", DRAWER, "2 cm", (0.36, 0.33, -16.0)) as (session, _):
        session.skills.world.articulations[DRAWER] = 0.22
        code, words = why_not(session, '<Close articulation="{articulation}"/>')
        assert code == "not_found", words


def test_a_door_whose_handle_is_not_recognised_is_believed_to_be_where_its_board_is_seen() -> None:
    with standing_open("open_fridge", DOOR, "55 deg", (0.057, 0.0, 0.0)) as (session, truth):
        world = session.skills.world
        look = f'<Sequence><MoveArm posture="look"/>{LOOK}</Sequence>'.replace("{articulation}", DOOR)
        code, words = why_not(session, look)
        assert code == "handle_not_found", words
        assert world.articulations[DOOR] == pytest.approx(truth.articulation_position(DOOR), abs=math.radians(3.0))
        behind = Pose2D(0.45, -0.1, -math.pi / 2)
        assert session.skills.known_costmap("carry").clearance_at(behind) < 0.0  # nobody drives through it


def test_the_tree_knows_how_far_a_door_stands_open_before_the_robot_drives() -> None:
    with open_session(load_run("close_fridge", seed=4003)) as session:
        world, tree = session.skills.world, session.load("close_furniture")
        start = world.base.pose
        assert DOOR not in world.articulations
        for _ in range(600):
            assert tree.tick_once() == RUNNING
            tree.sleep(0.05)
            if world.base.pose.distance_to(start) > 0.05:
                break
        else:
            raise AssertionError("it did not drive")
        assert world.articulations[DOOR] == pytest.approx(math.radians(55.0), abs=math.radians(4.0))
