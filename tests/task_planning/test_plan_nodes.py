"""Plan and ExecutePlan inside a tree: real beliefs and declarations, one ability that only changes beliefs."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from behaviours.computation import InlineComputation
from behaviours.context import DRIVEN, SkillContext
from behaviours.failure import NodeFailure
from behaviours.skill import Declaration, Skill, SkillCoroutine, SkillFailure
from bestman_bt.configuration.data import data_root
from bestman_bt.engine import (
    FAILURE,
    IDLE,
    RUNNING,
    SUCCESS,
    ManualClock,
    NodeRegistry,
    PortInformation,
    Tree,
    load_tree,
)
from bestman_bt.facts.predicate import Beliefs, Predicate
from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose, Pose2D
from bestman_bt.registry import BUILDERS, PLANNERS, PREDICATES, undone
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.task_planning.base import TaskPlanner
from bestman_bt.task_planning.builders.plan_tree import with_replanning
from bestman_bt.task_planning.builders.reactive import ReactiveBuilder
from bestman_bt.task_planning.builders.sequence import SequenceBuilder
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.nodes import TUCKED, beliefs_of
from bestman_bt.task_planning.state import PredicateError, read_state
from bestman_bt.task_planning.symbolic.facts import parse_fact
from bestman_bt.task_planning.symbolic.problem import PlanningProblem, TaskPlan
from bestman_bt.task_planning.symbolic.search import SymbolicPlanner
from bestman_bt.world_model.saved_beliefs import SavedBeliefs, restored
from bestman_bt.world_model.semantic_map import MapFurniture, MapSurface, SemanticMap
from bestman_bt.world_model.world_model import ObjectBelief, WorldModel
from tests.robot_models import arm_model, base_model

CUP = ObjectModel("cup", (1.0, 0.0, 0.0), 0.1, 0.5, (PlacedShape(Box((0.06, 0.06, 0.1)), Pose()),))


class Bring(Skill):
    """Believe that the object stands on the place. ``trouble``: what happens first, one after the other."""

    INPUT_PORTS: ClassVar = {"object": PortInformation(str), "place": PortInformation(str)}
    DECLARATION = Declaration(
        pre=("located({object})", "not on({object}, {place})"),
        effects=("on({object}, {place})",),
        parameters={"object": "object", "place": "place"},
        parts=("arm", "base"),
    )
    trouble: ClassVar[list[str]] = []
    halted: ClassVar[list[str]] = []

    def execute(self) -> SkillCoroutine[None]:
        """Take a little time."""
        name, place = self.get_input("object"), self.get_input("place")
        try:
            yield self.compute("bringing", lambda: None)
        except GeneratorExit:
            self.halted.append(self.name)
            raise
        if self.trouble and (what := self.trouble.pop(0)):
            if what == "vanish":
                return
            raise SkillFailure(what, f"the {name} slipped")
        self.skills.world.objects[name] = believed(name, place)


class LookFor(Skill):
    """Search, as the shipped ability does for beliefs: found where it is, else remembered where it is not."""

    INPUT_PORTS: ClassVar = {"object": PortInformation(str), "place": PortInformation(str)}
    DECLARATION = Declaration(
        pre=("unseen({object}, {place})",),
        effects=("located({object})", "on({object}, {place})", "forall p - place: not unseen({object}, p)"),
        parameters={"object": "object", "place": "place"},
        parts=("arm", "base"),
    )
    hidden: ClassVar[str] = ""
    looked: ClassVar[list[str]] = []

    def execute(self) -> SkillCoroutine[None]:
        """Take a little time."""
        name, place = self.get_input("object"), self.get_input("place")
        yield self.compute("bringing", lambda: None)
        self.looked.append(place)
        if place != self.hidden:
            self.skills.world.searched[name, place] = self.skills.clock.now()
            raise SkillFailure("not_found", f"the {name} was not seen on the {place}")
        self.skills.world.objects[name] = believed(name, place)


class Wipe(Skill):
    """Wipe, or soil: changes a fact that has no function."""

    INPUT_PORTS: ClassVar = {"place": PortInformation(str)}
    DECLARATION = Declaration(effects=("clean({place})", "not soiled({place})"), parameters={"place": "place"})

    def execute(self) -> SkillCoroutine[None]:
        """Nothing to wait for."""
        yield from ()


class Soil(Wipe):
    """The contrary."""

    DECLARATION = Declaration(
        effects=("forall p - place: not clean(p)", "soiled({place})"), parameters={"place": "place"}
    )


def believed(name: str, place: str) -> ObjectBelief:
    """An object that was seen on a surface."""
    return ObjectBelief(name, CUP, Pose(), 1.0, 0.01, 0.0, place)


def piece(name: str, x: float) -> MapFurniture:
    """A table with a top."""
    top = MapSurface("top", Pose(np.array([0.0, 0.0, 0.75])), (1.0, 1.0))
    return MapFurniture(name, Pose2D(x, 0.0, 0.0), (1.0, 1.0), 0.75, (top,), solid_at_lidar=True)


@pytest.fixture(scope="module")
def library() -> NodeRegistry:
    """All shipped nodes, and those of this file."""
    registry = node_registry()
    registry.register(Bring)
    registry.register(LookFor)
    registry.register(Wipe)
    registry.register(Soil)
    return registry


@pytest.fixture
def skills() -> Any:
    """A context as far as planning and ``Bring`` need one."""
    Bring.trouble.clear()
    Bring.halted.clear()
    LookFor.looked.clear()
    clock = ManualClock()
    context = SkillContext.__new__(SkillContext)
    context.clock = clock
    context.robot = RobotModel(
        "robot",
        "<robot name='r'/>",
        "base",
        {"base": base_model(), "arm": arm_model()},
        postures={"carry": {"joint": 0.0}},
    )
    context.world = WorldModel(
        SemanticMap(
            np.zeros((0, 4)), {"table": piece("table", 3.0), "desk": piece("desk", 6.0), "shelf": piece("shelf", 9.0)}
        )
    )
    context.world.models["cup"] = CUP
    context.world.objects["cup"] = believed("cup", "table/top")
    context.kinds = {"arm": ("arm",)}
    context.arm = SimpleNamespace(name="arm", carry=lambda mass, centre: None)
    context.joints = SimpleNamespace(positions=lambda: {"joint": 0.0})
    context.computation = InlineComputation(clock)
    context.stop = SimpleNamespace(latched=False)
    context.costs = {"task_planning": 0.2, "bringing": 0.2}
    context.failures = []
    return context


def planned(
    skills: Any,
    library: NodeRegistry,
    goal: str,
    builder: str = "reactive",
    limits: str = "",
    planner: str = "symbolic",
) -> Tree:
    """The shipped tree that reaches a goal."""
    how = f'planner="{planner}" builder="{builder}" limits="{limits}" replans="6"'
    main = f'<SubTree ID="ReachGoal" name="reach" goal="{goal}" {how}/>'
    xml = (
        '<root BTCPP_format="4" main_tree_to_execute="Main"><include path="plan_and_execute.xml"/>'
        f'<BehaviorTree ID="Main">{main}</BehaviorTree></root>'
    )
    return load_tree(xml, library, context=skills, clock=skills.clock, search_path=[data_root() / "trees"])


def run(tree: Tree) -> int:
    """Ticked to the end."""
    return tree.tick_while_running(max_ticks=500)


def unplanned(skills: Any) -> list[tuple[str, str]]:
    """Why ``Plan`` gave no plan, each time: code and words."""
    return [(failure.error_code, failure.why) for failure in skills.failures if "/Plan::" in failure.node]


@pytest.mark.parametrize("builder", ["sequence", "reactive", "backchain"])
def test_a_goal_is_planned_for_and_reached(skills: Any, library: NodeRegistry, builder: str) -> None:
    assert run(planned(skills, library, "on(cup, desk)", builder)) == SUCCESS
    assert skills.world.objects["cup"].surface == "desk/top"


def test_where_the_goal_is_believed_already_nothing_is_done(skills: Any, library: NodeRegistry) -> None:
    Bring.trouble.append("slip")
    assert run(planned(skills, library, "on(cup, table)")) == SUCCESS
    assert Bring.trouble == ["slip"]


def test_after_a_failure_it_plans_anew_from_what_is_believed_then(skills: Any, library: NodeRegistry) -> None:
    Bring.trouble.append("slip")
    tree = planned(skills, library, "on(cup, desk)", "sequence")
    plans: list[str] = []
    plan = next(node for node in tree.nodes if node.type_id == "Plan")
    plan.add_post_tick(lambda node, status: plans.append("plan") if status == SUCCESS else None)
    assert run(tree) == SUCCESS
    assert plans == ["plan", "plan"]
    assert any("the cup slipped; next is Bring(cup, desk/top)" in failure.why for failure in skills.failures)


def test_a_reactive_tree_recovers_by_itself(skills: Any, library: NodeRegistry) -> None:
    Bring.trouble.append("slip")
    assert run(planned(skills, library, "on(cup, desk)")) == SUCCESS
    assert not any(failure.error_code == "plan_failed" for failure in skills.failures)


def test_without_a_plan_it_reports_what_is_missing_and_does_not_ask_again(skills: Any, library: NodeRegistry) -> None:
    del skills.world.objects["cup"]
    skills.world.searched.update({("cup", "table/top"): 1.0, ("cup", "desk/top"): 1.0, ("cup", "shelf/top"): 1.0})
    assert run(planned(skills, library, "on(cup, desk)")) == FAILURE
    ((code, why),) = unplanned(skills)
    assert code == "unsolvable"
    assert "on(cup, desk/top) is out of reach" in why


@pytest.mark.parametrize("builder", ["sequence", "reactive", "backchain"])
def test_where_it_is_not_found_the_next_place_is_planned_for(
    skills: Any, library: NodeRegistry, builder: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    del skills.world.objects["cup"]
    monkeypatch.setattr(LookFor, "hidden", "shelf/top")
    assert run(planned(skills, library, "on(cup, table)", builder)) == SUCCESS
    assert len(LookFor.looked) == len(set(LookFor.looked))
    assert LookFor.looked[-1] == "shelf/top"
    assert skills.world.objects["cup"].surface == "table/top"


def test_after_all_places_were_searched_it_reports_it_with_their_names(skills: Any, library: NodeRegistry) -> None:
    del skills.world.objects["cup"]
    assert run(planned(skills, library, "on(cup, table)")) == FAILURE
    assert sorted(LookFor.looked) == ["desk/top", "shelf/top", "table/top"]
    why = "the cup was not found at: table/top, desk/top, shelf/top: on(cup, table/top) is out of reach"
    assert unplanned(skills) == [("unsolvable", why)]


class Listing(TaskPlanner):
    """A planner of somebody else, that returns what is no plan."""

    def plan(self, problem: PlanningProblem) -> TaskPlan:
        """Not as it should."""
        return []  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("target", "words"),
    [(f"{__name__}:Listing", "Listing should return a TaskPlan, got list"), ("no_module:X", "cannot be imported")],
)
def test_a_planner_that_gives_no_plan_fails_the_leaf_and_not_the_run(
    skills: Any, library: NodeRegistry, target: str, words: str
) -> None:
    with undone(PLANNERS):
        PLANNERS.add("odd", target)
        assert run(planned(skills, library, "on(cup, desk)", planner="odd")) == FAILURE
    code, why = unplanned(skills)[0]
    assert code == "no_plan"
    assert words in why


def test_limits_bind_the_plans_that_a_tree_makes(skills: Any, library: NodeRegistry) -> None:
    assert run(planned(skills, library, "on(cup, desk)", limits="steps=3; without=table")) == SUCCESS
    skills.world.objects["cup"] = believed("cup", "table/top")
    assert run(planned(skills, library, "on(cup, desk)", limits="without=desk")) == FAILURE
    ((code, why),) = unplanned(skills)
    assert code == "unsolvable"
    assert why.endswith("within the limits without=desk/top")
    assert skills.world.objects["cup"].surface == "table/top"


@pytest.mark.parametrize(
    ("goal", "why"),
    [
        ("on(cupp, desk)", "unknown object 'cupp'; did you mean 'cup'?"),
        (" ", "the goal is empty; name at least one fact"),
        ("onn(cup, desk)", "unknown predicate 'onn'; did you mean 'on'?"),
    ],
)
def test_a_goal_that_makes_no_sense_fails_with_the_closest_name(
    skills: Any, library: NodeRegistry, goal: str, why: str
) -> None:
    assert run(planned(skills, library, goal)) == FAILURE
    assert unplanned(skills) == [("bad_goal", why)]


def test_a_plan_is_not_blamed_for_what_failed_before_it_and_conditions_are_no_reason(
    skills: Any, library: NodeRegistry
) -> None:
    skills.failures.append(NodeFailure("before", "slip", "an older failure"))
    Bring.trouble.append("vanish")
    assert run(planned(skills, library, "on(cup, desk)", "sequence")) == SUCCESS
    (failed,) = [failure.why for failure in skills.failures if failure.error_code == "plan_failed"]
    assert failed == "next is Bring(cup, desk/top)"


def test_of_several_failures_of_a_plan_the_last_is_reported(skills: Any, library: NodeRegistry) -> None:
    skills.world.objects["mug"] = believed("mug", "table/top")
    Bring.trouble.append("slip")
    tree = carrying_out(skills, library, "on(cup, desk)")
    assert tree.tick_once() == RUNNING
    skills.failures.append(NodeFailure("other", "odd", "something else within this plan"))
    assert run(tree) == FAILURE
    assert skills.failures[-1].why.endswith("1_Bring: the cup slipped; next is Bring(cup, desk/top)")
    assert "something else" not in skills.failures[-1].why


def carrying_out(skills: Any, library: NodeRegistry, goal: str, builder: str = "sequence") -> Tree:
    """A tree of one ExecutePlan, with a plan of what is believed now."""
    problem = Domain.of(library).problem(Beliefs(skills.world), goal)
    xml = f'''<root BTCPP_format="4"><BehaviorTree ID="Main">
        <ExecutePlan name="execute" goal="{goal}" plan="{{plan}}" builder="{builder}"/></BehaviorTree></root>'''
    tree = load_tree(xml, library, context=skills, clock=skills.clock)
    tree.blackboard.set("plan", SymbolicPlanner().plan(problem))
    return tree


def test_a_plan_whose_tree_fails_a_dry_run_is_refused_before_anything_moves(skills: Any, library: NodeRegistry) -> None:
    tree = carrying_out(skills, library, "on(cup, desk)")
    skills.world.objects.clear()
    assert tree.tick_once() == FAILURE
    (failure,) = skills.failures
    assert failure.error_code == "refused"
    assert "in a dry run it fails here: located(cup) does not hold" in failure.why
    assert Bring.halted == []


def test_a_plan_that_was_halted_starts_anew_and_reports_what_it_does(skills: Any, library: NodeRegistry) -> None:
    tree = carrying_out(skills, library, "on(cup, desk)")
    inner: list[tuple[Tree, str]] = []
    tree.subscribe_to_inner(lambda made, leaf: inner.append((made, leaf.path)))
    assert tree.tick_once() == RUNNING
    assert tree.root.feedback_message == "1_Bring"
    tree.halt()
    tree.halt()
    assert Bring.halted == ["1_Bring"]
    assert run(tree) == SUCCESS
    skills.world.objects["cup"] = believed("cup", "table/top")
    assert run(tree) == SUCCESS
    assert [path for _, path in inner] == ["execute"] * 3
    assert all(made.clock is skills.clock for made, _ in inner)
    assert all(node.state == IDLE for made, _ in inner for node in made.nodes)


@pytest.mark.parametrize(("goal", "told"), [("on(cup, desk)", "Bring(cup, desk/top)"), ("on(cup, table)", None)])
def test_what_is_planned_is_reported(skills: Any, library: NodeRegistry, goal: str, told: str | None) -> None:
    xml = f'''<root BTCPP_format="4"><BehaviorTree ID="Main"><Plan goal="{goal}" plan="{{plan}}"/>
        </BehaviorTree></root>'''
    tree = load_tree(xml, library, context=skills, clock=skills.clock)
    assert run(tree) == SUCCESS
    assert tree.root.feedback_message == (told or "the goal is believed already")
    assert [str(action) for action in tree.blackboard.get("plan").actions] == ([told] if told else [])


def test_an_unknown_planner_is_reported_with_the_closest(skills: Any, library: NodeRegistry) -> None:
    assert run(planned(skills, library, "on(cup, desk)", planner="symbolik")) == FAILURE
    assert unplanned(skills)[0] == ("unknown_name", "unknown task planner 'symbolik'; did you mean 'symbolic'?")


@pytest.mark.parametrize(
    ("posture", "positions", "tucked"),
    [
        ([0.5, -1.0], [0.5, -1.0], True),
        ([0.5, -1.0], [0.5 + 0.9 * TUCKED, -1.0 - 0.9 * TUCKED], True),
        ([0.5, -1.0], [0.5, -1.0 - 1.1 * TUCKED], False),
        ([0.5, -1.0], [0.5 + 1.1 * TUCKED, -1.0], False),
        ([0.5, -1.0], [-0.5, 1.0], False),
    ],
)
def test_the_arm_is_tucked_where_every_joint_is(
    skills: Any, posture: list[float], positions: list[float], tucked: bool
) -> None:
    asked = SimpleNamespace(
        has=lambda kind: True,
        world=skills.world,
        robot=SimpleNamespace(posture=lambda name, joints: np.array(posture) if name == DRIVEN else None),
        arm_model=SimpleNamespace(joint_names=("a", "b")),
        arm_positions=lambda: np.array(positions),
    )
    assert beliefs_of(asked).tucked is tucked


@pytest.mark.parametrize(
    ("fact", "ports", "code", "words"),
    [
        ("on({object}, {place})", 'object="cup" place="table/top"', None, ""),
        ("not on({object}, desk/top) and located(cup)", 'object="cup"', None, ""),
        ("located(cup) and on(cup, desk/top)", "", "not_believed", "it is not believed that on(cup, desk/top)"),
        ("located(cup) and not located(cup)", "", "not_believed", "it is not believed that not located(cup)"),
        ("onn(cup, desk/top)", "", "unknown_name", "unknown predicate 'onn'; did you mean 'on'?"),
        ("drawer(attic/top)", "", "unknown_name", "no surface 'attic/top' in the map; known: table/top"),
    ],
)
def test_a_condition_asks_the_beliefs_and_reports_why_not(
    skills: Any, library: NodeRegistry, fact: str, ports: str, code: str | None, words: str
) -> None:
    xml = f'<root BTCPP_format="4"><BehaviorTree ID="Main"><Holds fact="{fact}" {ports}/></BehaviorTree></root>'
    assert run(load_tree(xml, library, context=skills, clock=skills.clock)) == (FAILURE if code else SUCCESS)
    assert [failure.error_code for failure in skills.failures] == ([code] if code else [])
    assert all(failure.why.startswith(words) for failure in skills.failures)


def test_an_unknown_builder_is_refused_before_anything_moves(skills: Any, library: NodeRegistry) -> None:
    Bring.trouble.append("slip")
    assert run(planned(skills, library, "on(cup, desk)", "reactiv")) == FAILURE
    assert skills.failures[0].why == "unknown tree builder 'reactiv'; did you mean 'reactive'?"
    assert Bring.trouble == ["slip"]


def test_a_halt_reaches_the_ability_that_runs(skills: Any, library: NodeRegistry) -> None:
    tree = planned(skills, library, "on(cup, desk)")
    for _ in range(6):
        assert tree.tick_once() == RUNNING
        tree.sleep(0.05)
    tree.halt()
    assert Bring.halted == ["1_Bring"]
    assert skills.world.objects["cup"].surface == "table/top"


def test_a_checked_plan_is_carried_out_first_and_only_where_it_fails_is_planned_anew(
    skills: Any, library: NodeRegistry
) -> None:
    domain = Domain.of(library)
    problem = domain.problem(Beliefs(skills.world), "on(cup, desk)")
    made = SequenceBuilder().build(SymbolicPlanner().plan(problem), problem.goal, leaves=["Bring"])
    xml = with_replanning(made, problem.goal, "symbolic", "sequence", library)
    Bring.trouble.extend(["", "slip"])
    for planned_anew in (False, True):
        tree = load_tree(xml, library, context=skills, clock=skills.clock)
        assert run(tree) == SUCCESS
        assert [node.last_result for node in tree.nodes if node.type_id == "Plan"] == [SUCCESS if planned_anew else 0]
        skills.world.objects["cup"] = believed("cup", "table/top")


def test_the_tree_of_a_plan_is_a_file_of_its_own_that_loads_again(skills: Any, library: NodeRegistry) -> None:
    domain = Domain(tuple(one for one in Domain.of(library).abilities if one.is_subtree))
    problem = domain.problem(Beliefs(skills.world), "on(cup, desk)")
    made = ReactiveBuilder().build(SymbolicPlanner().plan(problem), problem.goal)
    tree, again = made.load(library), load_tree(made.xml(library), library)
    assert [node.path for node in again.nodes] == [node.path for node in tree.nodes]
    assert [node.attributes for node in again.nodes] == [node.attributes for node in tree.nodes]


def test_a_fact_without_a_function_holds_from_the_ability_that_brings_it_about_to_the_one_that_undoes_it(
    skills: Any, library: NodeRegistry
) -> None:
    assert run(planned(skills, library, "clean(table)")) == SUCCESS
    fact = parse_fact("clean(table/top)")
    assert fact in read_state(Beliefs(skills.world))
    saved_world = restored(SavedBeliefs(achieved_effects=tuple(skills.world.achieved_effects)), None, skills.world)
    assert fact in read_state(Beliefs(saved_world))
    assert run(planned(skills, library, "soiled(desk)")) == SUCCESS
    assert read_state(Beliefs(skills.world)) >= {parse_fact("soiled(desk/top)")}
    assert fact not in read_state(Beliefs(skills.world))


def test_of_the_effects_of_abilities_only_facts_without_a_function_are_kept(skills: Any, library: NodeRegistry) -> None:
    assert run(planned(skills, library, "on(cup, desk) and clean(table)")) == SUCCESS
    assert skills.world.achieved_effects == ["clean(table/top); not soiled(table/top)"]


def test_a_predicate_may_be_declared_without_a_function_and_an_unknown_one_is_reported(
    skills: Any, library: NodeRegistry
) -> None:
    with undone(PREDICATES):
        PREDICATES.add("clean", Predicate("clean", {"place": "place"}, "the {place} is clean"))
        assert run(planned(skills, library, "clean(table)")) == SUCCESS
        asked = load_tree(
            '<root BTCPP_format="4"><BehaviorTree ID="Main"><Holds fact="claen(table/top)"/></BehaviorTree></root>',
            library,
            context=skills,
            clock=skills.clock,
        )
        assert run(asked) == FAILURE
        assert "did you mean 'clean'?" in skills.failures[-1].why


OWN = """
from bestman_bt.registry import tree_builder
from bestman_bt.task_planning.builders.base import TreeBuilder
from bestman_bt.facts.predicate import Predicate

@tree_builder("raises")
class Raises(TreeBuilder):
    def root(self, plan, goal, writer):
        return 1 / 0

@tree_builder("nothing")
class Nothing(TreeBuilder):
    def root(self, plan, goal, writer):
        return None

BAD = Predicate("bad", {"object": "object"}, "the {object} is bad", lambda beliefs, name: 1 / 0)
"""


def test_mistakes_in_own_builders_and_predicates_are_one_line_with_their_file(
    skills: Any, library: NodeRegistry, tmp_path: Any
) -> None:
    with undone(BUILDERS):
        with undone(PREDICATES):
            file = tmp_path / "own.py"
            file.write_text(OWN)
            node_registry([str(file)])
            place = f"(at {file}:"
            with pytest.raises(PredicateError, match="the predicate of bad.cup. raised ZeroDivisionError") as raised:
                Domain.of(library).problem(Beliefs(skills.world), "clean(table)")
            assert f"{place}16)" in str(raised.value)
        for builder, words in (
            ("raises", f"Raises.root raised ZeroDivisionError: division by zero {place}9)"),
            ("nothing", f"Nothing.root should return an XmlElement, got NoneType {place}13)"),
        ):
            assert run(planned(skills, library, "clean(desk)", builder)) == FAILURE
            assert words in str([failure.why for failure in skills.failures])
