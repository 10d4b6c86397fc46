"""Working in a drawer that stands open: looking into it, taking a cup out, putting it back elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.messages import Pose
from bestman_bt.runtime.robot_session import RobotSession
from hal.simulation.ground_truth import GroundTruth
from tests.behaviours.truth import audited, known_world, succeeds, why_not

pytestmark = pytest.mark.slow

DRAWER = "drawer_chest/drawer_3"
STANDING_OPEN = (
    "scene.furniture.drawer_chest.open={drawer_3: 30 cm}",
    "scene.robot_start.x=[0.2, 0.21]",
    "scene.robot_start.y=[-0.05, 0.05]",
    "scene.robot_start.yaw=[0.0, 0.02]",
    "scene.start_clearance=20 cm",
)


@pytest.fixture(scope="module")
def before_the_drawer() -> Iterator[tuple[RobotSession, GroundTruth]]:
    """A robot before an open drawer; it knows where the chest stands and how far the drawer is open."""
    with known_world(load_run("fetch_from_drawer", seed=3, settings=STANDING_OPEN)) as (session, truth):
        world = session.skills.world
        chest = next(piece for piece in session.setup.world.furniture if piece.name == "drawer_chest")
        mapped = replace(
            world.map.furniture["drawer_chest"], pose=chest.actual, position_error=0.008, heading_error=0.007
        )
        world.map = world.map.with_furniture(mapped)
        world.believe_articulation(DRAWER, truth.articulation_position(DRAWER))
        yield session, truth


def test_a_goal_in_a_drawer_goes_with_it_and_one_on_a_table_stays(before_the_drawer) -> None:
    session, _ = before_the_drawer
    for surface, shift in ((DRAWER, 0.30), ("table", 0.0)):
        tree = session.load(
            '<root BTCPP_format="4"><BehaviorTree ID="Main">'
            f'<GoalOnSurface goal="1.0;0.1;0.7" surface="{surface}" now="{{now}}"/></BehaviorTree></root>'
        )
        tree.tick_once()
        now: Pose = tree.blackboard.get("now")
        assert np.linalg.norm(now.position - [1.0, 0.1, 0.7]) == pytest.approx(shift, abs=0.001)


def test_how_far_a_drawer_is_open_is_told_from_beliefs(before_the_drawer) -> None:
    session, _ = before_the_drawer
    assert succeeds(session, f'<IsOpen articulation="{DRAWER}" at_least="0.25"/>')
    assert why_not(session, f'<IsOpen articulation="{DRAWER}" at_least="0.31"/>')[0] == "not_open"
    assert why_not(session, f'<IsOpen articulation="{DRAWER}" at_most="0.02"/>')[0] == "not_closed"
    assert why_not(session, '<IsOpen articulation="drawer_chest/drawer_7"/>')[0] == "unknown_articulation"


def test_what_cannot_be_done_is_reported(before_the_drawer) -> None:
    session, _ = before_the_drawer
    assert why_not(session, '<LookInto surface="drawer_chest/drawer_9"/>')[0] == "unknown_surface"
    assert why_not(session, '<GoalOnSurface goal="0;0;0" surface="drawer_9" now="{now}"/>')[0] == "unknown_surface"
    assert why_not(session, '<PlaceIn object="cup" pose="0.8;0;0.66"/>')[0] == "not_holding"
    assert why_not(session, f'<DetectObject object="cup" surface="{DRAWER}" camera="ceiling"/>')[0] == "no_camera"


def test_a_cup_is_found_in_the_drawer_taken_out_and_put_elsewhere_in_it(before_the_drawer) -> None:
    session, truth = before_the_drawer
    look = f'<LookInto surface="{DRAWER}" object="cup"/><DetectObject object="cup" surface="{DRAWER}" camera="wrist"/>'
    assert succeeds(session, f"<Sequence>{look}</Sequence>")
    seen = session.skills.world.objects["cup"]
    true = truth.object_pose("cup")
    assert np.linalg.norm(seen.pose.position - true.position) < 0.004
    assert seen.surface == DRAWER

    x, y, z = (float(value) for value in seen.pose.position)
    elsewhere = (x, y - 0.15 if y > 0.0 else y + 0.15, z)
    pose = ";".join(f"{value:.4f}" for value in elsewhere)
    take = '<PlanGrasp object="cup" grasps="{g}"/><Grasp object="cup" grasps="{g}"/><Retreat/>'
    put = f'<PlaceIn object="cup" pose="{pose}"/><Release object="cup" surface="{DRAWER}"/><Retreat distance="0.25"/>'
    assert succeeds(session, f"<Sequence>{take}</Sequence>")
    assert truth.object_pose("cup").position[2] > 0.85
    assert why_not(session, '<PlaceIn object="cup" pose="0.2;0;0.66"/>')[0] == "no_drawer"
    assert succeeds(session, f"<Sequence>{put}</Sequence>")
    session.robot.clock.sleep(0.5)
    put_down = truth.object_pose("cup")
    assert np.linalg.norm(put_down.position[:2] - elsewhere[:2]) < 0.01
    assert put_down.tilt < np.radians(2.0)
    judged = audited(session)
    assert judged.honest, judged.findings
    touched = {frozenset((contact.first, contact.second)) for contact in judged.collisions}
    fingers = {frozenset((f"panda_{side}finger", "cup")) for side in ("left", "right")}
    assert touched <= fingers | {frozenset(("cup", "drawer_chest"))}
