"""Opening a drawer by its handle: what the skill says, and where the drawer really is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.engine import FAILURE, RUNNING, SUCCESS, TreeLoadError
from bestman_bt.messages import Box, MotionStage, PlacedShape, Pose2D
from bestman_bt.runtime.robot_session import RobotSession
from bestman_bt.world_model.world_model import Obstacle
from tests.behaviours.at_the_table import failures_of, fastest, tick, tree_of
from tests.behaviours.scripted import DeclaredContacts
from tests.behaviours.truth import audited, known_world, why_not

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
DRAWER = "drawer_chest/drawer_3"
STAND = ("scene.robot_start.x=[0.0, 0.05]", "scene.robot_start.y=[-0.05, 0.05]", "scene.robot_start.yaw=[0.0, 0.05]")
BEFORE_IT = tuple(
    f"scene.robot_start.{axis}=[{value}, {value}]" for axis, value in (("x", 0.40), ("y", -0.36), ("yaw", 1.05))
)
OPEN = (
    '<Sequence><FindLookStand articulation="{articulation}" stand="{s}" front="{front}"/><LookAt point="{front}"/>'
    '<DetectHandle articulation="{articulation}" near="{front}" handle="{handle}"/>'
    '<Open articulation="{articulation}" handle="{handle}" opening="{at_least}"/></Sequence>'
)
STIFF = """
extends: chest_room
description: A chest whose drawers nobody can pull.
furniture:
  drawer_chest: {model: CHEST, at: [1.25, 0, 0]}
"""


def opens(session: RobotSession) -> bool:
    """Run the shipped tree on the drawer."""
    return tick(session.load("open_furniture"), 1500) == SUCCESS


def drawer_session(scene: str | Path = "chest_room", start: tuple[str, ...] = STAND):
    settings = (*start, "scene.start_clearance=20 cm")
    return known_world(load_run("open_drawer", scene=scene, seed=1, settings=settings))


@pytest.fixture(scope="module")
def opened():
    """A drawer that has been opened by the shipped tree, with the truth about it."""
    with drawer_session() as (session, truth):
        session.skills.contacts = DeclaredContacts()
        assert opens(session)
        yield session, truth


def test_a_drawer_is_opened_as_far_as_asked_and_seen_to_be_where_it_is(opened) -> None:
    session, truth = opened
    position = truth.articulation_position(DRAWER)
    assert position >= 0.20
    (declared,) = session.skills.contacts.declared
    assert (declared.thing, declared.max_force) == (DRAWER, 40.0 + 45.0 + 100.0)
    pressed = [
        contact.peak_force for contact in session.robot.audit_record().contacts if contact.articulation == DRAWER
    ]
    assert 40.0 < max(pressed) < 100.0
    assert session.skills.world.articulations[DRAWER] == pytest.approx(position, abs=0.008)
    assert all(truth.articulation_position(f"drawer_chest/drawer_{i}") < 1e-3 for i in (1, 2))
    assert session.skills.gripper.width() > 0.07
    assert not session.skills.gripper.pressing()
    assert audited(session).honest


def test_a_drawer_is_not_opened_farther_than_it_goes(opened) -> None:
    session, _ = opened
    asked = f'articulation="{DRAWER}" opening="80" handle="{next(iter(session.skills.world.handles))}"'
    for leaf in (
        f"<Open {asked}/>",
        f'<FindOpenStand {asked} stand="{{s}}"/>',
        f"<Close {asked[: asked.index('handle')]}/>",
    ):
        code, words = why_not(session, leaf)
        assert code == "bad_input", words
        assert f"80.0; {DRAWER} opens by 0 to" in words


def test_where_the_hand_gets_to_no_handle_and_no_front_what_keeps_it_from_there_is_recorded(opened) -> None:
    session, _ = opened
    world = session.skills.world
    name, belief = next(iter(world.handles.items()))
    crate = PlacedShape(Box((0.5, 1.0, 0.5)), belief.handle.pose)
    world.obstacles["crate"] = Obstacle("crate", (crate,), 0.0)
    try:
        asked = f'articulation="{DRAWER}"'
        for leaf, code in (
            (f'<Open {asked} handle="{name}" opening="0.3"/>', "no_grasp"),
            (f"<Close {asked}/>", "no_push"),
        ):
            assert why_not(session, leaf)[0] == code
            met = session.skills.failures[-1].obstacle
            assert met is not None
            assert (met.stage, "crate" in met.pairs[0]) == (MotionStage.REACH, True)
    finally:
        del world.obstacles["crate"]


def test_an_opening_that_is_no_number_is_refused_before_anything_moves(opened) -> None:
    session, _ = opened
    for leaf in ("Open", "Close"):
        with pytest.raises(TreeLoadError, match="port 'opening': inf is not accepted, but a finite number"):
            why_not(session, f'<{leaf} articulation="{DRAWER}" opening="inf"/>')


def test_a_drawer_that_slid_back_is_seen_to_be_open_less_than_it_was_felt(opened) -> None:
    session, truth = opened
    simulation = session.robot.simulation
    body, joint = simulation.built.articulations[DRAWER]
    simulation.engine.set_joint(body, joint, 0.12)
    look = (
        '<Sequence><FindLookStand articulation="{articulation}" stand="{s}" front="{front}"/><LookAt point="{front}"/>'
        '<DetectHandle articulation="{articulation}" near="{front}"/>'
        '<IsOpen articulation="{articulation}" at_least="0.2"/></Sequence>'
    )
    code, words = why_not(session, look)
    assert code == "not_open", words
    assert session.skills.world.articulations[DRAWER] == pytest.approx(truth.articulation_position(DRAWER), abs=0.012)


def test_a_drawer_that_does_not_move_is_reported_to_be_locked_and_is_let_go(tmp_path) -> None:
    chest = (ROOT / "assets/furniture/drawer_chest.yaml").read_text()
    (tmp_path / "stiff_chest.yaml").write_text(chest.replace("friction: 15 N", "friction: 400 N"))
    (tmp_path / "stiff.yaml").write_text(STIFF.replace("CHEST", str(tmp_path / "stiff_chest.yaml")))
    with drawer_session(tmp_path / "stiff.yaml", BEFORE_IT) as (session, truth):
        code, words = why_not(session, OPEN)
        assert code == "locked", words
        assert truth.articulation_position(DRAWER) < 0.005
        assert session.skills.gripper.width() > 0.07


@pytest.mark.parametrize("stopped", [False, True], ids=["halted", "stopped"])
def test_halted_while_it_pulls_it_lets_go_but_a_stopped_robot_keeps_its_hand_still(stopped: bool) -> None:
    with drawer_session(start=BEFORE_IT) as (session, truth):
        tree = session.load(tree_of(OPEN))
        while truth.articulation_position(DRAWER) < 0.05:
            assert tick(tree) == RUNNING
        if stopped:
            session.robot.stop()
        tree.halt()
        session.robot.clock.sleep(1.5)
        assert (session.skills.gripper.width() > 0.07) is not stopped
        left = truth.articulation_position(DRAWER)
        session.robot.clock.sleep(1.0)
        assert fastest(session) < 0.01
        assert truth.articulation_position(DRAWER) == pytest.approx(left, abs=1e-3)


def test_a_drawer_whose_handle_slips_out_of_the_hand_is_believed_to_be_where_it_was_left() -> None:
    with drawer_session(start=BEFORE_IT) as (session, truth):
        tree = session.load(tree_of(OPEN))
        while truth.articulation_position(DRAWER) < 0.08:
            assert tick(tree) == RUNNING
        session.skills.gripper.open()
        assert tick(tree, 600) == FAILURE
        assert failures_of(session)[0][0] == "grip_lost"
        left = truth.articulation_position(DRAWER)
        assert left > 0.08
        assert session.skills.world.articulations[DRAWER] == pytest.approx(left, abs=0.02)


def with_chest_mapped(session: RobotSession, x: float) -> Pose2D:
    """Put the chest of the map so many metres farther back than it stands; returns where it stands."""
    world = session.skills.world
    true = next(piece.actual for piece in session.setup.world.furniture if piece.name == "drawer_chest")
    mapped = replace(world.map.furniture["drawer_chest"], pose=true @ Pose2D(x, 0.0, 0.0))
    world.map = world.map.with_furniture(mapped)
    return true


def test_a_drawer_of_a_chest_that_stands_ten_centimetres_nearer_is_opened_as_far_as_asked_and_that_is_reported() -> (
    None
):
    with drawer_session(start=BEFORE_IT) as (session, truth):
        with_chest_mapped(session, 0.10)
        tree = session.load(tree_of(OPEN.replace("<Open ", '<Open opened="{opened}" ')))
        assert tick(tree, 600) == SUCCESS
        assert truth.articulation_position(DRAWER) >= 0.20
        assert tree.blackboard.get("opened") == pytest.approx(truth.articulation_position(DRAWER), abs=0.01)


def test_the_handle_of_a_chest_that_stands_ten_centimetres_farther_is_found_and_its_drawer_shut() -> None:
    with drawer_session(start=BEFORE_IT) as (session, _):
        true = with_chest_mapped(session, -0.10)
        assert tick(session.load(tree_of(OPEN[: OPEN.index("<Open")] + "</Sequence>")), 200) == SUCCESS
        assert session.skills.world.articulations[DRAWER] == 0.0
        assert session.skills.world.map.furniture["drawer_chest"].pose.distance_to(true) < 0.01


def test_a_handle_ten_centimetres_beside_where_the_map_says_is_found_and_pulled() -> None:
    with drawer_session() as (session, truth):
        world = session.skills.world
        chest = world.map.furniture["drawer_chest"]
        beside = Pose2D(chest.pose.x, chest.pose.y + 0.10, chest.pose.theta)
        world.map = world.map.with_furniture(replace(chest, pose=beside))
        assert opens(session)
        assert truth.articulation_position(DRAWER) >= 0.20


def test_what_is_not_on_the_map_or_was_never_seen_is_refused(opened) -> None:
    session, _ = opened
    asked = f'articulation="{DRAWER}" opening="0.2" handle="nowhere"'
    code, words = why_not(session, '<FindLookStand articulation="chest/drawer_9" stand="{s}" front="{f}"/>')
    assert code == "unknown_articulation"
    assert DRAWER in words
    assert why_not(session, f"<Open {asked}/>")[0] == "handle_not_found"
    assert why_not(session, f'<FindOpenStand {asked} stand="{{s}}"/>')[0] == "handle_not_found"
