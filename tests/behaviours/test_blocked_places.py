from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from behaviours.context import SkillContext
from bestman_bt.engine import SUCCESS, ManualClock, NodeRegistry, load_tree
from bestman_bt.facts.predicate import Beliefs
from bestman_bt.messages import Pose
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.explanation import explain
from bestman_bt.task_planning.symbolic.problem import Unsolvable
from bestman_bt.task_planning.symbolic.search import SymbolicPlanner
from bestman_bt.world_model.world_model import ObjectBelief, WorldModel
from tests.behaviours.at_the_table import tree_of

SCENE = load_scene("put_away", {})
MAP = semantic_map(draw_world(SCENE, 0))
TOP, DRAWER = "drawer_chest/top", "drawer_chest/drawer_3"


@pytest.fixture(scope="module")
def library() -> NodeRegistry:
    """All shipped nodes."""
    return node_registry()


@pytest.fixture
def skills() -> Any:
    """A context as far as these leaves go."""
    context: Any = SkillContext.__new__(SkillContext)
    context.clock, context.failures = ManualClock(), []
    context.world = WorldModel(map=MAP, models=dict(SCENE.models))
    context.arm = SimpleNamespace(name="arm", carry=lambda mass, centre: None)
    return context


def ticked(skills: Any, library: NodeRegistry, leaf: str) -> Any:
    """The tree of one leaf after a tick that succeeded."""
    tree = load_tree(tree_of(leaf), library, context=skills, clock=skills.clock)
    assert tree.tick_once() == SUCCESS
    return tree


def test_a_place_is_blocked_until_a_drawer_moves(skills: Any, library: NodeRegistry) -> None:
    ticked(skills, library, f'<BelieveBlocked surface="{TOP}"/>')
    assert skills.world.blocked == {TOP}
    skills.world.believe_articulation(DRAWER, 0.005)
    assert skills.world.blocked == {TOP}, "that was no more than a better measurement"
    skills.world.believe_articulation(DRAWER, 0.3)
    assert skills.world.blocked == set()


def test_the_short_name_of_a_place_blocks_its_surface(skills: Any, library: NodeRegistry) -> None:
    ticked(skills, library, '<BelieveBlocked surface="table"/>')
    assert skills.world.blocked == {"table/top"}


def test_what_is_forgotten_is_counted(skills: Any, library: NodeRegistry) -> None:
    skills.world.blocked = {TOP, "table/top"}
    assert ticked(skills, library, '<ForgetBlocked forgotten="{n}"/>').blackboard.get("n") == 2
    assert ticked(skills, library, '<ForgetBlocked forgotten="{n}"/>').blackboard.get("n") == 0


def test_a_place_that_was_seen_in_part_is_worth_a_second_look(skills: Any, library: NodeRegistry) -> None:
    world = skills.world
    world.searched = {("cup", TOP): 3.0, ("cup", "table/top"): 4.0}
    world.searched_in_part = {("cup", TOP)}
    assert not world.may_be_on("cup", TOP)
    assert ticked(skills, library, '<ForgetBlocked forgotten="{n}"/>').blackboard.get("n") == 1
    assert world.may_be_on("cup", TOP)
    assert not world.may_be_on("cup", "table/top"), "all of that was seen"


def test_a_drawer_that_did_not_open_is_tried_again_after_another_is_shut(skills: Any, library: NodeRegistry) -> None:
    world, hidden = skills.world, "drawer_chest/drawer_1"
    world.articulations[DRAWER] = 0.3
    world.blocked, world.given_places = {hidden}, {"cup": hidden}
    problem = Domain.of(library).problem(Beliefs(world), "located(cup)")
    actions = [str(action) for action in SymbolicPlanner().plan(problem).actions]
    assert actions == [f"CloseContainer({DRAWER})", f"OpenContainer({hidden})", f"Search(cup, {hidden})"]


def test_plans_go_round_a_blocked_place_or_unblock_it(skills: Any, library: NodeRegistry) -> None:
    skills.world.blocked = {"table/top"}
    problem = Domain.of(library).problem(Beliefs(skills.world), "located(cup)")
    plan = SymbolicPlanner().plan(problem)
    assert "Search(cup, table/top)" not in [str(action) for action in plan.actions]
    skills.world.given_places = {"cup": "table/top"}
    problem = Domain.of(library).problem(Beliefs(skills.world), "located(cup)")
    actions = [str(action) for action in SymbolicPlanner().plan(problem).actions]
    assert actions[-1] == "Search(cup, table/top)"
    assert actions[-2].startswith("CloseContainer("), "what stands open may be in the way"


def test_where_nothing_can_move_a_blocked_place_is_the_reason(skills: Any, library: NodeRegistry) -> None:
    scene = load_scene("swap_objects", {})
    skills.world = WorldModel(semantic_map(draw_world(scene, 0)), dict(scene.models), given_places={"cup": "table/top"})
    skills.world.blocked = {"table/top"}
    problem = Domain.of(library).problem(Beliefs(skills.world), "located(cup)")
    with pytest.raises(Unsolvable):
        SymbolicPlanner().plan(problem)
    assert "blocked(table/top) is believed, and nothing changes that" in explain(problem)


def test_an_open_drawer_is_in_the_way_each_time_it_is_open(skills: Any, library: NodeRegistry) -> None:
    """It is shut while a thing is brought from the chest's top to another place, and opened after that."""
    world = skills.world
    world.articulations[DRAWER] = 0.3
    ticked(skills, library, f'<BelieveBlocked surface="{TOP}"/>')
    assert world.in_the_way == {(DRAWER, TOP)}
    world.objects["cup"] = ObjectBelief("cup", SCENE.models["cup"], Pose(), 1.0, 0.0, 0.0, TOP)
    problem = Domain.of(library).problem(Beliefs(world), f"on(cup, {DRAWER})")
    actions = SymbolicPlanner().plan(problem).actions
    names = [str(action) for action in actions]
    elsewhere = actions[2].arguments[1]
    assert elsewhere not in (TOP, DRAWER)
    assert names == [
        f"CloseContainer({DRAWER})",
        f"PickUp(cup, {TOP})",
        f"PutAt(cup, {elsewhere})",
        f"OpenContainer({DRAWER})",
        f"PickUp(cup, {elsewhere})",
        f"PutAt(cup, {DRAWER})",
    ]
    assert ticked(skills, library, '<ForgetBlocked forgotten="{n}"/>').blackboard.get("n") == 1
    assert (world.blocked, world.in_the_way) == (set(), set())


def test_a_drawer_that_has_to_be_open_is_not_in_the_way(skills: Any, library: NodeRegistry) -> None:
    skills.world.articulations[DRAWER] = 0.3
    ticked(skills, library, f'<BelieveBlocked surface="{DRAWER}"/>')
    assert (skills.world.blocked, skills.world.in_the_way) == ({DRAWER}, set())
