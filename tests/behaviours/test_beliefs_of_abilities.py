"""The leaves of abilities that ask and write beliefs, such as Holds, FoundOn and TakeContainer."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from behaviours.context import SkillContext
from bestman_bt.engine import FAILURE, SUCCESS, ManualClock, NodeRegistry, Tree, load_tree
from bestman_bt.messages import VOXEL_FREE, VOXEL_UNKNOWN, Pose, Pose2D, VoxelGrid
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.world_model.openness import openness_of
from bestman_bt.world_model.world_model import BasePose, HeldObject, ObjectBelief, WorldModel
from tests.behaviours.at_the_table import tree_of
from tests.robot_models import arm_model

SCENE = load_scene("kitchen_furnished", {})
MAP = semantic_map(draw_world(SCENE, 0))
DRAWER = "drawer_chest/drawer_3"


@pytest.fixture(scope="module")
def library() -> NodeRegistry:
    """All shipped nodes."""
    return node_registry()


@pytest.fixture
def skills() -> Any:
    """A context as far as beliefs go: a map, a clock, the arm's encoders; no robot, no camera."""
    context: Any = SkillContext.__new__(SkillContext)
    context.clock = ManualClock()
    context.robot = RobotModel(
        "robot", "<robot name='r'/>", "base", {"arm": arm_model()}, postures={"carry": {"joint": 0}}
    )
    context.kinds = {"arm": ("arm",)}
    context.arm = SimpleNamespace(name="arm", carry=lambda mass, centre: None)
    context.joints = SimpleNamespace(positions=lambda: {"joint": 0.0})
    models = {name: SCENE.models[name] for name in ("cup", "mug")}
    context.world = WorldModel(map=MAP, models=models, base=BasePose(Pose2D(-1.5, -0.5, 0.0), 0.01, 0.01, 0.0))
    context.failures = []
    return context


def seen(skills: Any, name: str, surface: str, at: tuple[float, float] = (0.0, 0.0)) -> None:
    """Believe that an object stands on a surface, ``at`` metres from its middle."""
    furniture, found = skills.world.surface(surface)
    pose = furniture.pose.to_pose() @ found.pose @ Pose(np.array([*at, 0.05]))
    skills.world.objects[name] = ObjectBelief(name, skills.world.models[name], pose, 0.9, 0.01, 1.0, surface)


def ticked(skills: Any, library: NodeRegistry, leaf: str) -> tuple[int, list[str], Tree]:
    """The status of a leaf, what it said where it failed, and its tree."""
    before = len(skills.failures)
    tree = load_tree(tree_of(leaf), library, context=skills, clock=skills.clock)
    status = tree.tick_once()
    return status, [f"{one.error_code}: {one.why}" for one in skills.failures[before:]], tree


@pytest.mark.parametrize(
    ("fact", "said"),
    [
        ("on(mug, table/top) and hand_empty", []),
        ("tucked and not open(fridge/upper_door)", []),
        ("on(mug, counter/top)", ["not_believed: it is not believed that on(mug, counter/top)"]),
        ("hand_empty; not located(mug)", ["not_believed: it is not believed that not located(mug)"]),
        ("unseen(cup, table/top) and holding(mug)", ["not_believed: it is not believed that holding(mug)"]),
        ("onn(mug, table)", ["unknown_name: unknown predicate 'onn'; did you mean 'on'?"]),
        ("on(mug, table", ["bad_input: column 14 of 'on(mug, table': ',' is expected, not the end"]),
    ],
)
def test_facts_hold_as_far_as_they_are_believed(skills: Any, library: NodeRegistry, fact: str, said: list[str]) -> None:
    seen(skills, "mug", "table/top")
    status, failures, _ = ticked(skills, library, f'<Holds fact="{fact}"/>')
    assert (status, failures) == (FAILURE if said else SUCCESS, said)


def test_ports_stand_for_the_names_in_a_fact(skills: Any, library: NodeRegistry) -> None:
    seen(skills, "mug", "table/top")
    leaf = '<Holds fact="on({{object}}, {{place}})" object="{name}" place="table/top"/>'
    assert ticked(skills, library, leaf.format(name="mug"))[0] == SUCCESS
    assert ticked(skills, library, leaf.format(name="cup"))[0] == FAILURE


def test_what_was_found_where_it_was_looked_for_is_found_on(skills: Any, library: NodeRegistry) -> None:
    seen(skills, "mug", "table")
    assert ticked(skills, library, '<FoundOn object="mug" surface="table/top"/>')[:2] == (SUCCESS, [])
    assert skills.world.searched == {}


def test_where_it_was_not_found_is_remembered_with_the_time(skills: Any, library: NodeRegistry) -> None:
    skills.clock.advance(3.0)
    status, failures, _ = ticked(skills, library, '<FoundOn object="mug" surface="table"/>')
    assert (status, failures) == (FAILURE, ["not_found: the mug was not seen on the table/top"])
    assert skills.world.searched == {("mug", "table/top"): 3.0}
    assert not skills.world.may_be_on("mug", "table/top")
    assert skills.world.may_be_on("mug", "counter/top")


def scanned(skills: Any, hidden: float) -> None:
    """Believe that a scan has mapped the space above the table, but for so much of it, beginning at its left side."""
    furniture, surface = skills.world.surface("table/top")
    corner = Pose(np.array([-surface.size[0] / 2 - 0.1, -surface.size[1] / 2 - 0.1, -0.1]))
    shape = tuple(round((extent + 0.2) / 0.02) for extent in (*surface.size, 0.3))
    states = np.full(shape, VOXEL_FREE, dtype=np.uint8)
    states[:, : round((0.1 + hidden * surface.size[1]) / 0.02)] = VOXEL_UNKNOWN
    skills.world.occupancy = VoxelGrid(states, 0.02, furniture.pose.to_pose() @ surface.pose @ corner, 1.0)


def test_where_a_part_was_hidden_it_is_searched_in_part_alone(skills: Any, library: NodeRegistry) -> None:
    leaf = '<{} object="mug" surface="table"/>'
    scanned(skills, hidden=0.3)
    status, failures, _ = ticked(skills, library, leaf.format("FoundOrSeenAll"))
    assert (status, failures[0].partition(":")[0]) == (FAILURE, "part_hidden")
    assert ticked(skills, library, leaf.format("FoundOn"))[0] == FAILURE
    assert skills.world.searched_in_part == {("mug", "table/top")}
    scanned(skills, hidden=0.0)
    assert ticked(skills, library, leaf.format("FoundOrSeenAll"))[0] == SUCCESS
    assert ticked(skills, library, leaf.format("FoundOn"))[0] == FAILURE
    assert skills.world.searched_in_part == set(), "now all of it was seen"


def test_what_is_found_needs_no_further_look(skills: Any, library: NodeRegistry) -> None:
    scanned(skills, hidden=0.3)
    seen(skills, "mug", "table")
    assert ticked(skills, library, '<FoundOrSeenAll object="mug" surface="table"/>')[0] == SUCCESS


def test_what_was_seen_on_the_way_elsewhere_is_not_found_here_but_known(skills: Any, library: NodeRegistry) -> None:
    seen(skills, "mug", "counter/top")
    status, failures, _ = ticked(skills, library, '<FoundOn object="mug" surface="table"/>')
    assert (status, failures) == (FAILURE, ["not_found: the mug was seen on the counter/top, not on the table/top"])
    assert skills.world.searched == {}


@pytest.mark.parametrize("container", [DRAWER, "fridge/upper_door"])
def test_of_a_container_its_furniture_and_what_open_and_shut_mean_are_reported(
    skills: Any, library: NodeRegistry, container: str
) -> None:
    ports = 'furniture="{furniture}" opening="{opening}" shut="{shut}"'
    status, failures, tree = ticked(skills, library, f'<TakeContainer container="{container}" {ports}/>')
    assert (status, failures) == (SUCCESS, [])
    furniture, leaf = container.split("/")
    openness = openness_of(MAP.furniture[furniture].articulation(leaf))
    assert [tree.blackboard.get(port) for port in ("furniture", "opening", "shut")] == [
        furniture,
        openness.asked,
        openness.shut,
    ]
    assert 0.0 < openness.shut < openness.enough <= openness.asked


def test_a_container_that_did_not_open_is_believed_locked(skills: Any, library: NodeRegistry) -> None:
    assert ticked(skills, library, f'<BelieveLocked container="{DRAWER}"/>')[:2] == (SUCCESS, [])
    assert skills.world.locked == {DRAWER}
    assert ticked(skills, library, f'<Holds fact="locked({DRAWER})"/>')[0] == SUCCESS


@pytest.mark.parametrize("leaf", ["TakeContainer", "BelieveLocked"])
def test_a_container_that_there_is_not_is_reported_with_those_that_there_are(
    skills: Any, library: NodeRegistry, leaf: str
) -> None:
    status, (said,), _ = ticked(skills, library, f'<{leaf} container="drawer_chest/drawer_9"/>')
    assert status == FAILURE
    assert said.startswith("unknown_articulation: no door or drawer 'drawer_chest/drawer_9' in the map; known: ")
    assert DRAWER in said
    assert skills.world.locked == set()


def held(skills: Any, name: str) -> None:
    """Believe that the hand holds it."""
    skills.held = HeldObject(name, skills.world.models[name], Pose(np.zeros(3)), 0.05)


def room(skills: Any, library: NodeRegistry) -> np.ndarray:
    """Where in the drawer, open by 0.3 m, the held mug is to stand, in the drawer's frame."""
    skills.world.articulations[DRAWER] = 0.3
    leaf = f'<FindRoomIn object="mug" surface="{DRAWER}" pose="{{pose}}"/>'
    status, failures, tree = ticked(skills, library, leaf)
    assert (status, failures) == (SUCCESS, [])
    furniture, surface = skills.world.surface(DRAWER)
    return ((furniture.pose.to_pose() @ surface.pose).inverse() @ tree.blackboard.get("pose")).position


def test_room_in_a_drawer_is_within_its_walls_and_in_the_part_that_has_come_out(
    skills: Any, library: NodeRegistry
) -> None:
    held(skills, "mug")
    x, y, z = room(skills, library)
    furniture, surface = skills.world.surface(DRAWER)
    radius = float(np.linalg.norm(skills.world.models["mug"].size[:2])) / 2
    assert abs(y) <= surface.size[1] / 2 - radius - 0.03 + 1e-9
    assert -surface.size[0] / 2 + radius + 0.03 <= x + 1e-9
    assert float(surface.pose.position[0]) + x <= -furniture.footprint[0] / 2 + 1e-9
    assert z == pytest.approx(-float(skills.world.models["mug"].bounds()[0, 2]))


def test_room_is_away_from_what_is_believed_to_be_in_the_drawer(skills: Any, library: NodeRegistry) -> None:
    held(skills, "mug")
    alone = room(skills, library)
    seen(skills, "cup", DRAWER, (float(alone[0]), float(alone[1])))
    beside = room(skills, library)
    radii = [float(np.linalg.norm(skills.world.models[name].size[:2])) / 2 for name in ("mug", "cup")]
    assert np.linalg.norm(beside[:2] - alone[:2]) >= sum(radii) + 0.03 - 1e-9


def test_in_a_shut_drawer_there_is_no_room_and_without_the_object_none_is_looked_for(
    skills: Any, library: NodeRegistry
) -> None:
    leaf = f'<FindRoomIn object="mug" surface="{DRAWER}" pose="{{pose}}"/>'
    assert ticked(skills, library, leaf)[:2] == (FAILURE, ["not_holding: the hand does not hold the mug"])
    held(skills, "mug")
    status, (said,), _ = ticked(skills, library, leaf)
    assert status == FAILURE
    assert said.startswith("surface_full: no room for the mug is believed to be left in the drawer_chest/drawer_3")
