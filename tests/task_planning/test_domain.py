from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from behaviours.skill import Declaration, Skill
from bestman_bt.configuration.data import data_root
from bestman_bt.engine import In, NodeRegistry, load_tree
from bestman_bt.facts.predicate import Beliefs, Predicate
from bestman_bt.messages import ObjectModel, Pose, Pose2D
from bestman_bt.registry import PREDICATES, UnknownNameError
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.task_planning.abilities import DeclarationError, abilities_of, operator_of, shipped_abilities
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.state import holds, known_predicates, read_state, things
from bestman_bt.task_planning.symbolic.facts import parse_fact
from bestman_bt.task_planning.symbolic.problem import GoalError, Unsolvable
from bestman_bt.task_planning.symbolic.search import SymbolicPlanner
from bestman_bt.world_model.world_model import BasePose, HeldObject, ObjectBelief, ObjectChange, WorldModel

SCENE = load_scene("kitchen_furnished", {})
MAP = semantic_map(draw_world(SCENE, 0))
DRAWER = "drawer_chest/drawer_3"


@pytest.fixture
def world() -> WorldModel:
    models = {name: SCENE.models[name] for name in ("cup", "mug")}
    return WorldModel(map=MAP, models=models, base=BasePose(Pose2D(-1.5, -0.5, 0.0), 0.01, 0.01, 0.0))


@pytest.fixture(scope="module")
def domain() -> Domain:
    return Domain.of(NodeRegistry())


def seen(world: WorldModel, name: str, surface: str, stamp: float = 1.0) -> None:
    model: ObjectModel = world.models[name]
    world.objects[name] = ObjectBelief(name, model, Pose(np.zeros(3)), 0.9, 0.01, stamp, surface)


def believed(world: WorldModel, text: str) -> bool:
    return holds(Beliefs(world), parse_fact(text))


def plan(domain: Domain, world: WorldModel, goal: str) -> list[str]:
    problem = domain.problem(Beliefs(world), goal)
    return [str(action) for action in SymbolicPlanner().plan(problem).actions]


def test_of_what_was_never_seen_nothing_is_believed_but_that_it_is_not_known(world):
    facts = {str(fact) for fact in read_state(Beliefs(world)) if "mug" in fact.arguments}
    assert facts == {f"unseen(mug, {name})" for name, kind in things(world).items() if kind in ("place", "drawer")}


def test_a_door_that_one_walks_through_contains_nothing(world):
    fridge = MAP.furniture["fridge"]
    assert "fridge/upper_door" in things(world)
    passage = replace(MAP, furniture={**MAP.furniture, "fridge": replace(fridge, is_passage=True, surfaces=())})
    assert not [name for name in things(replace(world, map=passage)) if name.startswith("fridge")]


def test_a_name_without_its_number_is_the_first_and_the_others_are_reported(domain, world, caplog):
    (closed,) = domain.problem(Beliefs(world), "closed(drawer)").goal
    assert closed.fact.arguments == ("drawer_chest/drawer_1",)
    assert "there are also drawer_chest/drawer_2, drawer_chest/drawer_3" in caplog.text
    with pytest.raises(GoalError, match="'fridge' is ambiguous"):
        domain.problem(Beliefs(world), "closed(fridge)")


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ("on(mug, microwave)", "'microwave' is taken for microwave/top; there is also microwave/inside"),
        ("closed(door)", "'door' is taken for microwave/door; there are also"),
    ],
)
def test_a_short_name_that_could_mean_others_is_reported(world, domain, caplog, goal, words):
    domain.problem(Beliefs(world), goal)
    assert words in caplog.text


def test_a_short_name_that_means_one_thing_is_not_talked_about(world, domain, caplog):
    domain.problem(Beliefs(world), "on(mug, table) and closed(drawer_3)")
    assert not caplog.records


def test_facts_that_get_along_are_no_contradiction(world, domain):
    text = "on(mug, table) and on(cup, table) and on(mug, table) and hand_empty and not open(door)"
    goal = domain.problem(Beliefs(world), text).goal
    assert [str(literal) for literal in goal] == [
        "on(mug, table/top)",
        "on(cup, table/top)",
        "hand_empty",
        "not open(microwave/door)",
    ]


def test_a_predicate_of_somebody_else_reports_what_it_excludes(world):
    wet = Predicate("wet", {"place": "place"}, "the {place} is wet", lambda *_: False, excludes=("dry({place})",))
    dry = Predicate("dry", {"place": "place"}, "the {place} is dry", lambda *_: False)
    domain = Domain((), {"wet": wet, "dry": dry})
    assert len(domain.problem(Beliefs(world), "wet(table) and dry(counter)").goal) == 2
    with pytest.raises(GoalError, match="cannot hold together"):
        domain.problem(Beliefs(world), "dry(table) and wet(table)")


def test_that_a_thing_is_not_somewhere_has_to_be_known(world, domain):
    """What was never seen is nowhere: that would be a success without a look."""
    assert [step.split("(")[0] for step in plan(domain, world, "not on(mug, table)")] == ["Search"]
    seen(world, "mug", "counter/top")
    assert plan(domain, world, "not on(mug, table)") == []
    assert plan(domain, world, "not holding(cup)") == []  # the robot knows its own hand


def test_what_was_seen_is_on_its_surface_by_its_full_name(world):
    seen(world, "mug", "table")
    assert believed(world, "on(mug, table/top)")
    assert believed(world, "located(mug)")
    assert not believed(world, "unseen(mug, counter/top)")


def test_what_the_hand_holds_is_nowhere_else(world):
    world.hands["arm"] = HeldObject("mug", world.models["mug"], Pose(np.zeros(3)), 0.05)
    state = {str(fact) for fact in read_state(Beliefs(world))}
    assert {"holding(mug)", "located(mug)"} <= state
    assert not {"hand_empty", "holding(cup)", "located(cup)"} & state


def test_of_what_was_seen_on_no_surface_only_that_it_is_somewhere_is_believed(world):
    seen(world, "mug", None)
    facts = {str(fact) for fact in read_state(Beliefs(world)) if "mug" in fact.arguments}
    assert facts == {"located(mug)"}


def test_what_stands_behind_two_doors_is_accessible_when_both_are_open(world, monkeypatch):
    doors = ("fridge/upper_door", "fridge/lower_door")
    monkeypatch.setattr("bestman_bt.facts.accessible.containers_before", lambda furniture, surface: doors)
    for positions, accessible in (((1.5, 0.0), False), ((0.0, 1.5), False), ((1.5, 1.5), True)):
        world.articulations.update(zip(doors, positions, strict=True))
        assert believed(world, "accessible(fridge/shelf_1)") is accessible


def test_only_what_moves_with_a_drawer_is_one(world):
    state = {str(fact) for fact in read_state(Beliefs(world)) if fact.predicate == "drawer"}
    assert state == {f"drawer(drawer_chest/drawer_{number})" for number in (1, 2, 3)}


def test_where_it_was_looked_for_in_vain_it_is_not_expected_until_it_was_lost_again(world):
    world.searched["mug", "table/top"] = 3.0
    assert not believed(world, "unseen(mug, table/top)")
    assert believed(world, "unseen(mug, counter/top)")
    world.changes.append(ObjectChange("removed", "mug", stamp=5.0))
    assert believed(world, "unseen(mug, table/top)")


def test_it_is_sought_where_it_was_told_to_be_and_only_then_elsewhere(world):
    world.given_places["mug"] = DRAWER
    assert believed(world, f"unseen(mug, {DRAWER})")
    assert not believed(world, "unseen(mug, table/top)")
    world.searched["mug", DRAWER] = 2.0
    assert believed(world, "unseen(mug, table/top)")


@pytest.mark.parametrize(
    ("position", "is_open", "is_shut"), [(0.0, False, True), (0.1, False, False), (0.28, True, False)]
)
def test_a_drawer_may_be_neither_open_nor_shut(world, position, is_open, is_shut):
    world.articulations[DRAWER] = position
    assert believed(world, f"open({DRAWER})") is is_open
    assert believed(world, f"closed({DRAWER})") is is_shut
    assert believed(world, f"accessible({DRAWER})") is is_open


def test_each_shelf_of_the_fridge_is_behind_its_own_door_and_the_top_behind_none(world):
    state = {str(fact) for fact in read_state(Beliefs(world)) if fact.predicate == "behind"}
    assert "behind(fridge/shelf_1, fridge/lower_door)" in state
    assert "behind(fridge/shelf_5, fridge/upper_door)" in state
    assert "behind(microwave/inside, microwave/door)" in state
    assert not any(text.startswith(("behind(fridge/top", "behind(table", "behind(microwave/top")) for text in state)


@pytest.mark.parametrize("heading", [0.0, 0.7, 2.0])
def test_the_base_is_near_what_it_stands_at(world, heading):
    """Its own middle counts, from the edge of the footprint, however that is turned."""
    table = replace(MAP.furniture["table"], pose=Pose2D(1.0, 2.0, heading), footprint=(1.6, 0.6))
    world.map = MAP.with_furniture(table)
    for beside, near in (((0.8 + 1.1, 0.0), True), ((0.8 + 1.3, 0.0), False), ((0.0, 0.3 + 1.1), True),
                         ((0.0, 0.3 + 1.3), False), ((-0.8 - 0.8, 0.3 + 0.8), True), ((0.8 + 0.9, 0.3 + 0.9), False),
                         ((0.1, 0.1), True)):  # fmt: skip
        at = table.pose.apply(np.array([beside]))[0]
        world.base = replace(world.base, pose=Pose2D(*at, heading + 1.0))
        assert believed(world, "near(table/top)") is near, beside
    assert not believed(world, "near(fridge/top)")


def test_every_predicate_goes_by_the_name_that_it_is_registered_under():
    assert {name: predicate.name for name, predicate in known_predicates().items()} == {n: n for n in PREDICATES}
    with pytest.raises(UnknownNameError, match="did you mean 'open'"):
        holds(Beliefs(WorldModel(map=MAP)), parse_fact("opne(x)"))


def test_what_is_in_the_hand_is_a_thing_though_nobody_described_it(world):
    world.hands["arm"] = HeldObject("spanner", world.models["mug"], Pose(np.zeros(3)), 0.05)
    assert things(world)["spanner"] == "object"
    assert things(world)["mug"] == "object"


def test_an_abbreviating_predicate_is_not_part_of_a_state_nor_of_a_planning_problem(world, domain):
    problem = domain.problem(Beliefs(world))
    assert "accessible" not in problem.predicates
    assert not [fact for fact in problem.state if fact.predicate == "accessible"]
    assert all("accessible" not in str(need) for one in problem.operators for need in (*one.pre, *one.hold))


def test_only_what_is_given_is_asked_of(world):
    world.articulations[DRAWER] = 0.28
    facts = {str(fact) for fact in read_state(Beliefs(world), {DRAWER: "drawer"})}
    assert f"open({DRAWER})" in facts
    assert not any("table" in fact or "fridge" in fact for fact in facts)


def test_a_drawer_is_a_place_and_a_container(world, domain):
    problem = domain.problem(Beliefs(world))
    assert DRAWER in problem.of_type("place")
    assert DRAWER in problem.of_type("container")
    assert "fridge/upper_door" not in problem.of_type("place")


def test_from_a_closed_drawer_it_is_searched_taken_brought_and_the_drawer_closed(world, domain):
    world.given_places["mug"] = DRAWER
    assert plan(domain, world, "on(mug, table) and closed(drawer_3)") == [
        f"OpenContainer({DRAWER})",
        f"Search(mug, {DRAWER})",
        f"PickUp(mug, {DRAWER})",
        "PutAt(mug, table/top)",
        f"CloseContainer({DRAWER})",
    ]


def test_what_holds_already_needs_no_plan(world, domain):
    seen(world, "mug", "table/top")
    assert plan(domain, world, "on(mug, table) and not open(drawer_3)") == []


def test_behind_a_locked_door_nothing_is_planned(world, domain):
    seen(world, "mug", "fridge/shelf_5")
    world.locked.add("fridge/upper_door")
    with pytest.raises(Unsolvable, match="on\\(mug, table/top\\)"):
        plan(domain, world, "on(mug, table)")


def test_what_was_looked_for_everywhere_cannot_be_planned_for(world, domain):
    world.searched.update({("mug", name): 1.0 for name, kind in things(world).items() if kind in ("place", "drawer")})
    with pytest.raises(Unsolvable, match="holding\\(mug\\)"):
        plan(domain, world, "holding(mug)")


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ("on(mugg, table)", "unknown object 'mugg'; did you mean 'mug'?"),
        ("onn(mug, table)", "unknown predicate 'onn'; did you mean 'on'?"),
        ("on(mug, tabel/top)", "unknown place 'tabel/top'; did you mean 'table/top'?"),
        ("on(mug)", "on takes 2 of these: object, place"),
        ("open(mug)", "mug is an object, and a container is expected"),
        ("on(table, mug)", "table is a place, and an object is expected"),
        ("not located(mug)", "located cannot be negated"),
        ("open(drawer_3) and closed(drawer_3)", f"open({DRAWER}) and closed({DRAWER}) cannot hold together"),
        ("closed(drawer_3) and accessible(drawer_3)", "cannot hold together"),
        ("on(mug, table) and on(mug, counter)", "on(mug, table/top) and on(mug, counter/top) cannot hold together"),
        ("holding(mug) and on(mug, table)", "on(mug, table/top) and holding(mug) cannot hold together"),
        ("holding(mug) and holding(cup)", "holding(mug) and holding(cup) cannot hold together"),
        ("hand_empty and holding(cup)", "holding(cup) and hand_empty cannot hold together"),
        ("hand_empty and not hand_empty", "hand_empty and not hand_empty cannot hold together"),
        ("open(drawer_chest)", "'drawer_chest' is ambiguous"),
        ("not accessible(drawer_3)", "cannot be negated"),
        ("forall p - place: near(p)", "forall is not accepted"),
        ("", "the goal is empty; name at least one fact"),
        (" ", "the goal is empty; name at least one fact"),
        ("accessible(table)", "accessible(table/top) always holds; omit it"),
    ],
)
def test_a_goal_that_makes_no_sense_is_refused_with_the_closest_names(world, domain, goal, words):
    with pytest.raises(GoalError) as raised:
        domain.problem(Beliefs(world), goal)
    assert words in str(raised.value)


def test_what_is_short_for_others_is_written_out_in_a_goal(world, domain):
    problem = domain.problem(Beliefs(world), f"accessible({DRAWER})")
    assert [str(literal) for literal in problem.goal] == [f"open({DRAWER})"]


def test_the_shipped_abilities_load_as_subtrees_with_their_ports():
    def call(name: str, ports: Iterable[str]) -> str:
        given = " ".join(f'{port}="x"' for port in ports)
        return f'<SubTree ID="{name}" {given}/>'

    calls = "".join(call(ability.name, ability.operator.parameters) for ability in abilities_of(NodeRegistry()))
    tree = load_tree(
        f'<root BTCPP_format="4"><include path="subtrees/abilities.xml"/><BehaviorTree ID="All"><Sequence>{calls}'
        "</Sequence></BehaviorTree></root>",
        node_registry(),
        search_path=[data_root() / "trees"],
        main_tree="All",
    )
    assert len(tree.nodes) > 50
    assert shipped_abilities().is_file()


class Wipe(Skill):
    """Wipe a place."""

    place_ = In(str, port="place")
    DECLARATION = Declaration(
        parameters={"place": "place"}, pre=("hand_empty",), effects=("clean({place})",), cost=2.0, parts=("arm",)
    )


def test_a_third_party_leaf_that_declares_parameters_is_planned_with(world):
    registry = NodeRegistry()
    registry.register(Wipe)
    assert plan(Domain.of(registry), world, "clean(table)") == ["Wipe(table/top)"]


@pytest.mark.parametrize(
    ("declared", "words"),
    [
        (Declaration(parameters={"place": "place"}, effects=("clean({plaec})",)), "no parameter {plaec}"),
        (Declaration(parameters={}, effects=("clean(",)), "Wipe: effects: column"),
        (Declaration(parameters={}, cost=0.0), "cost is 0.0; more than 0 is accepted"),
    ],
)
def test_a_declaration_that_cannot_be_read_is_reported(declared, words):
    with pytest.raises(DeclarationError) as raised:
        operator_of("Wipe", declared)
    assert words in str(raised.value)


def test_a_predicate_with_other_arguments_than_declared_is_reported():
    class Odd(Skill):
        """Odd."""

        place_ = In(str, port="place")
        DECLARATION = Declaration(parameters={"place": "place"}, effects=("on({place}, {place})",))

    registry = NodeRegistry()
    registry.register(Odd)
    with pytest.raises(DeclarationError, match="on takes object, place"):
        Domain.of(registry)


def test_a_type_that_nothing_has_is_refused_with_the_closest() -> None:
    tall = Predicate("tall", {"object": "objct"}, "the {object} is tall")
    with pytest.raises(DeclarationError, match="tall: object has the type 'objct'; did you mean 'object'"):
        Domain((), {"tall": tall})
