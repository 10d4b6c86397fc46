"""Trees of plans, ticked in symbolic worlds: what they do, skip, redo, and when they give up."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, permutations, product

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from bestman_bt.engine import FAILURE, RUNNING, SUCCESS, NodeRegistry
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.task_planning.builders.backchain import BackchainBuilder
from bestman_bt.task_planning.builders.base import TreeBuilder
from bestman_bt.task_planning.builders.plan_tree import depend, parallel_steps, sequential_steps, with_replanning
from bestman_bt.task_planning.builders.reactive import ReactiveBuilder
from bestman_bt.task_planning.builders.regression import kernels, ready_steps
from bestman_bt.task_planning.builders.sequence import SequenceBuilder
from bestman_bt.task_planning.limits import PlanLimits
from bestman_bt.task_planning.simulation import SymbolicWorld, dry_run, load_simulated
from bestman_bt.task_planning.symbolic.facts import parse_literals
from bestman_bt.task_planning.symbolic.grounding import instantiate
from bestman_bt.task_planning.symbolic.problem import (
    Action,
    Fact,
    Literal,
    Operator,
    PlanningError,
    PlanningProblem,
    TaskPlan,
)
from tests.task_planning.disturbed_world import Upset
from tests.task_planning.kitchen_domain import DOOR, FETCH, FETCH_GOAL, facts, kitchen, operator, plan_of

ALL = [SequenceBuilder(), ReactiveBuilder(), BackchainBuilder()]
RECOVERING = [ReactiveBuilder(), BackchainBuilder()]


def run(builder: TreeBuilder, world: SymbolicWorld, plan: tuple[str, ...] = FETCH) -> int:
    """The status in which the tree of a plan ends."""
    tree = builder.build(plan_of(world.problem, *plan), world.problem.goal)
    return dry_run(tree.document().to_xml(), world, NodeRegistry()).status


def done(world: SymbolicWorld) -> tuple[str, ...]:
    """What was done in a world."""
    return tuple(map(str, world.done))


@pytest.mark.parametrize("builder", ALL)
def test_undisturbed_each_tree_does_the_plan_and_reaches_the_goal(builder: TreeBuilder) -> None:
    world = SymbolicWorld(kitchen(FETCH_GOAL))
    assert run(builder, world) == SUCCESS
    assert done(world) == FETCH
    assert world.reached


@pytest.mark.parametrize("builder", ALL)
def test_an_empty_plan_succeeds_where_the_goal_holds_and_only_there(builder: TreeBuilder) -> None:
    assert run(builder, SymbolicWorld(kitchen("on(can, table)")), ()) == SUCCESS
    assert run(builder, SymbolicWorld(kitchen("on(mug, table)")), ()) == FAILURE


@pytest.mark.parametrize("builder", RECOVERING)
def test_what_is_true_already_is_skipped(builder: TreeBuilder) -> None:
    problem = kitchen(FETCH_GOAL)
    world = SymbolicWorld(problem)
    world.state = problem.state | facts("open(drawer_1)")
    assert run(builder, world) == SUCCESS
    assert done(world) == FETCH[1:]


@pytest.mark.parametrize("builder", RECOVERING)
def test_what_was_undone_is_redone(builder: TreeBuilder) -> None:
    world = Upset(kitchen(FETCH_GOAL), after={"OpenContainer(drawer_1)": "not open(drawer_1)"})
    assert run(builder, world) == SUCCESS
    assert done(world) == (FETCH[0], *FETCH)


@pytest.mark.parametrize("builder", RECOVERING)
def test_an_action_that_fails_once_is_tried_again(builder: TreeBuilder) -> None:
    world = Upset(kitchen(FETCH_GOAL), fails={"PickUp(mug, chest/drawer_1)"})
    assert run(builder, world) == SUCCESS
    assert done(world) == FETCH


def test_a_sequence_notices_a_broken_pre_condition_before_the_skill_begins() -> None:
    world = Upset(kitchen(FETCH_GOAL), after={"OpenContainer(drawer_1)": "not open(drawer_1)"})
    assert run(SequenceBuilder(), world) == FAILURE
    assert world.begun == ["OpenContainer(drawer_1)"]
    assert world.failures[-1] == ("2_is_ready", "open(drawer_1) does not hold")


@pytest.mark.parametrize("builder", ALL)
def test_a_tree_fails_where_its_plan_does_not_help_any_more(builder: TreeBuilder) -> None:
    elsewhere = "not on(mug, chest/drawer_1) and on(mug, chest/drawer_2)"
    world = Upset(kitchen(FETCH_GOAL), after={"OpenContainer(drawer_1)": elsewhere})
    assert run(builder, world) == FAILURE
    assert world.begun == ["OpenContainer(drawer_1)"]


@pytest.mark.parametrize("builder", ALL)
def test_an_action_that_never_takes_effect_does_not_run_for_ever(builder: TreeBuilder) -> None:
    class Stubborn(SymbolicWorld):
        def finish(self, action: object) -> str:
            self.done.append(action)
            return ""

    world = Stubborn(kitchen(FETCH_GOAL))
    assert run(builder, world) == FAILURE
    assert 1 <= len(world.done) <= 50


@pytest.mark.parametrize("builder", ALL)
def test_a_broken_hold_condition_halts_the_action_that_runs(builder: TreeBuilder) -> None:
    problem = kitchen(
        "on(can, chest/drawer_1)", "open(drawer_1)", "holding(can)", without=("on(can, table)", "hand_empty")
    )
    world = Upset(problem)
    tree = builder.build(plan_of(problem, "PutAt(can, chest/drawer_1)"), problem.goal)
    ticked = load_simulated(tree.document().to_xml(), world, NodeRegistry())
    assert ticked.tick_exactly_once() == RUNNING
    world.state -= facts("open(drawer_1)")
    assert ticked.tick_while_running(max_ticks=20) == FAILURE
    assert world.done == []


def test_actions_of_different_parts_that_do_not_depend_on_each_other_go_side_by_side() -> None:
    plan = plan_of(kitchen("tucked"), "PickUp(can, table)", "TuckArm()", "GoTo(table)", "PutAt(can, table)")
    assert [str(step) for step in parallel_steps(plan)] == [
        "PickUp(can, table)",
        "TuckArm() beside GoTo(table)",
        "PutAt(can, table)",
    ]


def test_actions_that_need_what_the_other_changes_stay_in_order() -> None:
    plan = plan_of(kitchen(FETCH_GOAL), *FETCH)
    assert parallel_steps(plan) == sequential_steps(plan)


def test_where_one_of_two_side_by_side_is_undone_only_that_one_is_redone() -> None:
    world = Upset(kitchen("tucked and near(table)"), fails={"GoTo(table)"})
    assert run(ReactiveBuilder(), world, ("TuckArm()", "GoTo(table)")) == SUCCESS
    assert world.begun == ["TuckArm()", "GoTo(table)", "GoTo(table)"]


def test_kernels_are_what_must_hold_for_the_rest_to_reach_the_goal() -> None:
    problem = kitchen(FETCH_GOAL)
    table = kernels(sequential_steps(plan_of(problem, *FETCH)), problem.goal)
    assert table[-1] == frozenset(parse_literals(FETCH_GOAL))
    assert table[2] == frozenset(parse_literals("holding(mug) and open(drawer_1)"))


def test_a_step_leads_to_the_goal_where_later_ones_may_be_left_out() -> None:
    problem = kitchen(FETCH_GOAL)
    stairs = ready_steps(sequential_steps(plan_of(problem, *FETCH)), problem.goal, 8)
    assert [str(each.step) for each in stairs] == list(FETCH)
    assert [each.holds_in(problem.state) for each in stairs] == [True, False, False, False]
    assert stairs[2].holds_in(facts("holding(mug)", "open(drawer_1)"))
    assert stairs[2].ways == (frozenset(parse_literals("holding(mug)")),)
    assert not any(each.holds_in(facts("hand_empty")) for each in stairs)


def test_a_way_in_which_a_later_step_or_the_goal_is_ready_anyhow_is_not_asked_for() -> None:
    """Before opening: where the mug is on the table, the drawer is shut, or shutting it comes next."""
    problem = kitchen("on(mug, table) and closed(drawer_1)", "closed(drawer_1)")
    half = [
        operator("OpenContainer", DOOR, "not open({container})", "open({container}) and not closed({container})"),
        operator("CloseContainer", DOOR, "not closed({container})", "closed({container}) and not open({container})"),
    ]  # fmt: skip
    problem = replace(problem, operators=(*problem.operators[:2], *half))
    stairs = ready_steps(sequential_steps(plan_of(problem, *FETCH)), problem.goal, 8)
    assert [len(each.ways) for each in stairs] == [1, 1, 1, 1]
    assert stairs[0].ways[0] >= frozenset(parse_literals("on(mug, chest/drawer_1)"))


def test_a_drawer_that_is_pushed_shut_while_its_mug_is_in_the_hand_need_not_be_shut_any_more() -> None:
    world = Upset(kitchen(FETCH_GOAL), after={"PickUp(mug, chest/drawer_1)": "not open(drawer_1)"})
    assert run(ReactiveBuilder(), world) == SUCCESS
    assert done(world) == FETCH[:3]


def test_of_two_things_the_one_that_somebody_has_put_in_its_place_is_left_there() -> None:
    problem = kitchen("on(mug, table) and on(can, chest/drawer_2)", "open(drawer_1)", "open(drawer_2)")
    plan = (*FETCH[1:3], "PickUp(can, table)", "PutAt(can, chest/drawer_2)")
    world = Upset(problem, after={FETCH[1]: "not on(can, table) and on(can, chest/drawer_2)"})
    assert run(ReactiveBuilder(), world, plan) == SUCCESS
    assert done(world) == FETCH[1:3]


def test_the_ways_of_a_step_stay_few_however_many_things_may_be_left_out() -> None:
    problem, actions = many_drawers(8)
    steps = sequential_steps(plan_of(problem, *actions))
    stairs = ready_steps(steps, problem.goal, most_ways=8)
    assert max(len(each.ways) for each in stairs) == 8
    assert all(kernel in each.ways for kernel, each in zip(kernels(steps, problem.goal), stairs, strict=False))


def test_a_plan_that_undoes_its_own_goal_is_refused() -> None:
    problem = kitchen("open(drawer_1)")
    with pytest.raises(PlanningError, match=r"CloseContainer\(drawer_1\) undoes open\(drawer_1\)"):
        kernels(sequential_steps(plan_of(problem, "OpenContainer(drawer_1)", "CloseContainer(drawer_1)")), problem.goal)


def test_a_step_cannot_come_before_what_needs_the_contrary_of_its_own_condition() -> None:
    (step,) = sequential_steps(plan_of(kitchen("open(drawer_1)"), "OpenContainer(drawer_1)"))
    with pytest.raises(PlanningError, match="not hand_empty and the contrary would have to hold"):
        kernels([step], parse_literals("open(drawer_1) and not hand_empty"))


def test_back_chaining_stays_small_where_each_object_needs_a_drawer_of_its_own() -> None:
    """Expanded afresh wherever something needs it, this plan of 24 actions would have millions of nodes."""
    problem, actions = many_drawers(8)
    world = SymbolicWorld(problem)
    plan = plan_of(problem, *actions)
    xml = BackchainBuilder().build(plan, problem.goal).document().to_xml()
    assert xml.count("<SubTree") < 150
    assert dry_run(xml, world, NodeRegistry()).status == SUCCESS


def many_drawers(count: int) -> tuple[PlanningProblem, tuple[str, ...]]:
    """Each thing from the table into a drawer of its own."""
    goal = " and ".join(f"on(thing_{i}, chest/drawer_{i})" for i in range(count))
    problem = kitchen(goal, *(f"on(thing_{i}, table)" for i in range(count)))
    objects = {"table": "place"}
    behind = []
    actions: list[str] = []
    for i in range(count):
        objects |= {f"thing_{i}": "object", f"chest/drawer_{i}": "place", f"drawer_{i}": "container"}
        behind.append(f"behind(chest/drawer_{i}, drawer_{i})")
        actions += [f"OpenContainer(drawer_{i})", f"PickUp(thing_{i}, table)", f"PutAt(thing_{i}, chest/drawer_{i})"]
    return PlanningProblem(objects, problem.state | facts(*behind), problem.goal, problem.operators), tuple(actions)


FACTS = [Fact(name) for name in "abcd"]
STATES = [frozenset(some) for count in range(5) for some in combinations(FACTS, count)]
SETTINGS = st.dictionaries(st.sampled_from(FACTS), st.booleans(), max_size=3)


def action_of(name: str, pre: dict[Fact, bool], effects: dict[Fact, bool], parts: Sequence[str] = ("arm",)) -> Action:
    add, delete = ([fact for fact, holds in effects.items() if holds is value] for value in (True, False))
    literals = tuple(Literal(fact, not holds) for fact, holds in pre.items())
    made = Operator(name, {}, literals, add=tuple(add), delete=tuple(delete), parts=tuple(parts))
    return instantiate(PlanningProblem({}, frozenset(), (), (made,)), made, [])


@st.composite
def plans(draw: st.DrawFn) -> TaskPlan:
    parts = st.sampled_from([("arm",), ("base",), ("arm", "base"), ("head",), ()])
    drawn = [(draw(SETTINGS), draw(SETTINGS), draw(parts)) for _ in range(draw(st.integers(1, 4)))]
    return TaskPlan(tuple(action_of(f"Act{i}", *each) for i, each in enumerate(drawn)))


def reaches(actions: Sequence[Action], state: frozenset[Fact], goal: frozenset[Literal]) -> bool:
    for action in actions:
        if action.broken_in(state):
            return False
        state = action.applied_to(state)
    return all(literal.holds_in(state) for literal in goal)


def begun_with(index: int, actions: Sequence[Action]) -> Iterator[tuple[Action, ...]]:
    """An action and any of those after it, in their order."""
    rest = actions[index + 1 :]
    for count in range(len(rest) + 1):
        for some in combinations(rest, count):
            yield (actions[index], *some)


@settings(max_examples=60, deadline=None)
@given(plans(), SETTINGS.filter(bool))
def test_a_step_is_ready_only_where_it_leads_to_the_goal_and_some_step_is_where_one_does(
    plan: TaskPlan, wanted: dict[Fact, bool]
) -> None:
    goal = frozenset(Literal(fact, not holds) for fact, holds in wanted.items())
    steps = sequential_steps(plan)
    try:
        kernel = kernels(steps, goal)
    except PlanningError:
        assume(False)
    stairs = ready_steps(steps, goal, 1000)
    for state in STATES:
        ready = [each.holds_in(state) for each in stairs]
        leads = [any(reaches(some, state, goal) for some in begun_with(i, plan.actions)) for i in range(len(plan))]
        assert all(may for is_ready, may in zip(ready, leads, strict=True) if is_ready)
        assert any(ready) or not any(leads) or all(literal.holds_in(state) for literal in goal)
        for index, needed in enumerate(kernel):
            assert all(one.holds_in(state) for one in needed) is reaches(plan.actions[index:], state, goal)


@settings(max_examples=80, deadline=None)
@given(plans())
def test_steps_keep_the_order_of_what_depends_on_each_other_and_begin_as_early_as_they_can(plan: TaskPlan) -> None:
    steps = parallel_steps(plan)
    assert sorted(str(action) for step in steps for action in step.actions) == sorted(map(str, plan.actions))
    number = {action: index for index, step in enumerate(steps) for action in step.actions}
    for index, action in enumerate(plan.actions):
        before = [number[one] for one in plan.actions[:index] if depend(one, action)]
        assert number[action] == max(before, default=-1) + 1
    for one, other in permutations(plan.actions, 2):
        assert depend(one, other) is depend(other, one)
        if not depend(one, other):
            assert one.parts
            assert other.parts
            for state in STATES:
                if not one.broken_in(state) and not other.broken_in(state):
                    assert not other.broken_in(one.applied_to(state))
                    assert other.applied_to(one.applied_to(state)) == one.applied_to(other.applied_to(state))


@pytest.mark.parametrize(
    ("one", "other", "parts", "dependent"),
    [
        (({}, {"a": True}), ({"a": True}, {}), ("arm", "base"), True),
        (({"a": True}, {}), ({}, {"a": False}), ("arm", "base"), True),
        (({}, {"a": True}), ({}, {"a": False}), ("arm", "base"), True),
        (({}, {"a": False}), ({}, {"a": False}), ("arm", "base"), True),
        (({"a": True}, {"b": True}), ({"a": True}, {"c": False}), ("arm", "base"), False),
        (({"a": True}, {"b": True}), ({"a": True}, {"c": False}), ("arm", "arm"), True),
        (({}, {"b": True}), ({}, {"c": False}), ("", "arm"), True),
    ],
)
def test_the_order_matters_where_one_changes_what_the_other_changes_or_needs_or_a_part_is_shared(
    one: tuple[dict[str, bool], ...], other: tuple[dict[str, bool], ...], parts: tuple[str, str], dependent: bool
) -> None:
    first, second = (
        action_of("Act", *({Fact(name): holds for name, holds in each.items()} for each in given), part.split())
        for given, part in ((one, parts[0]), (other, parts[1]))
    )
    assert depend(first, second) is depend(second, first) is dependent


def test_a_plan_goes_one_by_one_where_nothing_may_go_side_by_side() -> None:
    plan = ("TuckArm()", "GoTo(table)")
    for parallel, begun in product((True, False), (ReactiveBuilder, SequenceBuilder)):
        problem = kitchen("tucked and near(table)")
        xml = begun(parallel=parallel).build(plan_of(problem, *plan), problem.goal).document().to_xml()
        assert ("<Parallel" in xml) is parallel
        assert ('success_count="-1" failure_count="1"' in xml) is parallel
        world = SymbolicWorld(problem)
        assert dry_run(xml, world, NodeRegistry()).status == SUCCESS
        assert world.reached


def test_builders_take_their_own_numbers_of_attempts() -> None:
    problem = kitchen(FETCH_GOAL)
    plan = plan_of(problem, *FETCH)
    for builder in (
        ReactiveBuilder(attempts=7, rounds=2),
        BackchainBuilder(attempts=7),
    ):
        xml = builder.build(plan, problem.goal).document().to_xml()
        assert 'name="attempts" num_attempts="7"' in xml
    assert (
        'name="round_by_round" num_attempts="8"'
        in ReactiveBuilder(rounds=2).build(plan, problem.goal).document().to_xml()
    )


BACKCHAINED = """\
<RetryUntilSuccessful name="attempts" num_attempts="3">
    <Sequence name="reach_the_goal">
        <Fallback name="2_unless_done">
            <Holds name="2_is_done" fact="holding(mug)"/>
            <Sequence name="2_do">
                <Holds name="2_can_be_done" fact="hand_empty and on(mug, chest/drawer_1)"/>
                <Fallback name="1_unless_done">
                    <Holds name="1_is_done" fact="open(drawer_1)"/>
                    <Sequence name="1_do">
                        <Holds name="1_can_be_done" fact="hand_empty and not locked(drawer_1) and not open(drawer_1)"/>
                        <SubTree ID="OpenContainer" name="1_OpenContainer" container="drawer_1"/>
                    </Sequence>
                </Fallback>
                <Holds name="2_is_ready" fact="hand_empty and on(mug, chest/drawer_1) and open(drawer_1)"/>
                <SubTree ID="PickUp" name="2_PickUp" object="mug" place="chest/drawer_1"/>
            </Sequence>
        </Fallback>
        <Holds name="goal_reached" fact="holding(mug)"/>
    </Sequence>
</RetryUntilSuccessful>"""


def test_a_back_chained_tree_reads_as_the_plan_that_it_was_made_from(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = kitchen("holding(mug)")
    plan = plan_of(problem, *FETCH[:2])
    written = BackchainBuilder().build(plan, problem.goal).document().to_xml()
    assert "\n".join(" " * 8 + line for line in BACKCHAINED.splitlines()) in written
    monkeypatch.setattr("bestman_bt.task_planning.builders.backchain.MAX_ACTIONS", 2)
    assert BackchainBuilder().build(plan, problem.goal).document().to_xml() == written
    monkeypatch.setattr("bestman_bt.task_planning.builders.backchain.MAX_ACTIONS", 1)
    with pytest.raises(PlanningError, match="the tree would have more than 1 actions"):
        BackchainBuilder().build(plan, problem.goal)


def chained(count: int) -> TaskPlan:
    """Actions of which each needs the one before; the first one, the innermost, has most levels: a guard, a subtree."""
    actions = []
    for number in range(count):
        name, parameters, needed = "AlwaysSuccess", dict[str, str](), (Literal(Fact(f"f{number - 1}")),)
        if number == 0:
            name, parameters, needed = "OpenContainer", {"container": "container"}, ()
        hold = () if number else (Literal(Fact("reachable")),)
        made = Operator(name, parameters, needed, hold=hold, add=(Fact(f"f{number}"),))
        problem = PlanningProblem({"drawer_1": "container"}, frozenset(), (), (made,))
        actions.append(instantiate(problem, made, ["drawer_1"] if number == 0 else []))
    return TaskPlan(tuple(actions))


def test_back_chaining_nests_as_many_actions_as_can_be_loaded_and_refuses_more() -> None:
    goal = [Literal(Fact("f117"))]
    made = BackchainBuilder().build(chained(118), goal, ["AlwaysSuccess"])
    assert with_replanning(made, goal, "symbolic", "backchain", node_registry()).count('_AlwaysSuccess"') == 117
    expected = "more than 118 actions would be nested, but a tree has at most 256 levels; use the builder 'reactive'"
    for count in (119, 400):
        with pytest.raises(PlanningError, match=expected):
            BackchainBuilder().build(chained(count), [Literal(Fact(f"f{count - 1}"))], ["AlwaysSuccess"])


def test_a_reactive_tree_has_as_many_steps_as_can_be_loaded_and_more_are_refused() -> None:
    goal = [Literal(Fact("f232"))]
    made = ReactiveBuilder().build(chained(233), goal, ["AlwaysSuccess"])
    assert with_replanning(made, goal, "symbolic", "reactive", node_registry()).count('_AlwaysSuccess"') == 232
    with pytest.raises(PlanningError, match="the plan has 234 steps, but a tree has at most 256 levels"):
        ReactiveBuilder().build(chained(234), [Literal(Fact("f233"))], ["AlwaysSuccess"])


def test_back_chaining_names_the_condition_that_no_order_of_the_tree_keeps(monkeypatch: pytest.MonkeyPatch) -> None:
    """It finds an order for each plan that the kernels accept, so an empty kernel stands in for such a plan."""
    monkeypatch.setattr("bestman_bt.task_planning.builders.backchain.kernels", lambda *_: (frozenset(),))
    problem = kitchen("open(drawer_1)")
    with pytest.raises(
        PlanningError, match=r"OpenContainer\(drawer_1\) needs hand_empty, .*; use the builder 'reactive'"
    ):
        BackchainBuilder().build(plan_of(problem, FETCH[0]), problem.goal)


def strips(state: str, goal: str, **actions: tuple[str, str]) -> tuple[PlanningProblem, TaskPlan]:
    """A problem, and the plan of its actions in their order, each given as conditions and effects."""
    made = tuple(operator(name, {}, *texts) for name, texts in actions.items())
    problem = PlanningProblem({}, facts(*state.split()), parse_literals(goal), made)
    return problem, plan_of(problem, *(f"{name}()" for name in actions))


def test_back_chaining_executes_an_action_whose_effect_holds_for_another_one_that_is_needed_later() -> None:
    problem, plan = strips("p", "p and r", Both=("not q", "p and q"), Use=("q", "r"))
    world = SymbolicWorld(problem)
    assert (
        dry_run(BackchainBuilder().build(plan, problem.goal).document().to_xml(), world, NodeRegistry()).status
        == SUCCESS
    )
    assert done(world) == ("Both()", "Use()")


def test_back_chaining_moves_an_action_that_would_undo_a_goal_before_the_one_that_restores_it() -> None:
    """``Use`` takes away what ``Restore`` needs, so ``Restore`` cannot be executed afterwards."""
    problem, plan = strips(
        "p q",
        "p and r",
        Prepare=("", "x and not p"),
        Restore=("q", "p"),
        Use=("x", "r and not q"),
    )
    tree = BackchainBuilder().build(plan, problem.goal)
    world = SymbolicWorld(problem)
    assert dry_run(tree.document().to_xml(), world, NodeRegistry()).status == SUCCESS
    assert done(world) == ("Prepare()", "Restore()", "Use()")
    world = SymbolicWorld(problem)
    world.state |= facts("x")
    assert dry_run(tree.document().to_xml(), world, NodeRegistry()).status == SUCCESS
    assert done(world) == ("Use()",)


@st.composite
def executed_plans(draw: st.DrawFn) -> tuple[TaskPlan, tuple[Literal, ...]]:
    """A plan that is executable from some state, and facts that hold at its end."""
    state, actions = draw(st.sampled_from(STATES)), []
    some = st.sets(st.sampled_from(FACTS), max_size=2)
    for number in range(draw(st.integers(2, 7))):
        needed = {fact: fact in state for fact in draw(some)}
        actions.append(action_of(f"Act{number}", needed, draw(SETTINGS.filter(bool))))
        state = actions[-1].applied_to(state)
    goal = draw(st.sets(st.sampled_from(FACTS), min_size=1))
    return TaskPlan(tuple(actions)), tuple(Literal(fact, fact not in state) for fact in goal)


@pytest.mark.slow
@settings(max_examples=200, deadline=None)
@given(executed_plans())
def test_back_chaining_reaches_the_goal_from_each_state_from_which_the_plan_does(
    planned: tuple[TaskPlan, tuple[Literal, ...]],
) -> None:
    plan, goal = planned
    initial = kernels(sequential_steps(plan), goal)[0]
    xml = BackchainBuilder().build(plan, goal).document().to_xml()
    problem = PlanningProblem({}, frozenset(), goal, tuple(action.operator for action in plan.actions))
    for state in STATES:
        if all(literal.holds_in(state) for literal in initial):
            world = SymbolicWorld(replace(problem, state=state))
            assert dry_run(xml, world, NodeRegistry()).status == SUCCESS
            assert world.reached


def test_a_tree_that_plans_anew_keeps_to_the_limits_and_counts_that_it_was_given() -> None:
    goal = parse_literals("tucked")
    problem = kitchen("tucked")
    made = SequenceBuilder().build(TaskPlan(()), problem.goal)
    limits = PlanLimits(max_actions=7)
    xml = with_replanning(made, goal, "symbolic", "backchain", node_registry(), limits, replans=5)
    anew = next(line for line in xml.splitlines() if 'name="anew"' in line)
    for entry in ('limits="steps=7"', 'replans="5"', 'builder="backchain"', 'planner="symbolic"', 'goal="tucked"'):
        assert entry in anew
    assert 'limits=""' in with_replanning(made, goal, "symbolic", "backchain", node_registry())


def test_the_staircase_of_a_long_plan_is_made_at_once() -> None:
    """44 steps, in which any of 20 objects may be carried next: ways grow with the plan, not with its subsets."""
    objects = {f"o{number}": "object" for number in range(20)}
    base = kitchen("hand_empty")
    shut = [
        operator("OpenContainer", DOOR, "hand_empty and closed({container})",
                 "not closed({container}) and open({container})"),
        operator("CloseContainer", DOOR, "hand_empty and open({container})",
                 "closed({container}) and not open({container})"),
    ]  # fmt: skip
    problem = replace(
        base,
        objects={**base.objects, **objects},
        state=facts(*(f"on(o{n}, chest/drawer_{n % 2 + 1})" for n in range(20)), "hand_empty", "closed(drawer_1)",
                    "closed(drawer_2)", "behind(chest/drawer_1, drawer_1)", "behind(chest/drawer_2, drawer_2)"),
        goal=parse_literals(" and ".join([*(f"on({name}, table)" for name in objects), "closed(drawer_1)"])),
        operators=(*base.operators[:2], *shut),
    )  # fmt: skip
    plan = []
    for drawer in (1, 2):
        plan.append(f"OpenContainer(drawer_{drawer})")
        for number in range(drawer - 1, 20, 2):
            plan += [f"PickUp(o{number}, chest/drawer_{drawer})", f"PutAt(o{number}, table)"]
        plan.append(f"CloseContainer(drawer_{drawer})")
    stairs = ready_steps(sequential_steps(plan_of(problem, *plan)), problem.goal, 8)
    assert len(stairs) == 44
    assert stairs[0].holds_in(problem.state)
    assert not any(stair.holds_in(problem.state) for stair in stairs[1:])
    assert all(len(stair.ways) <= 8 for stair in stairs)
