"""Planning inside a tree: one leaf makes a plan from the beliefs, another executes it."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from behaviours.context import DRIVEN, SkillContext
from behaviours.skill import (
    ArticulationName,
    ErrorReporting,
    ObjectName,
    RobotNode,
    Skill,
    SkillCondition,
    SkillCoroutine,
    SkillFailure,
    SurfaceName,
)
from bestman_bt.engine import RUNNING, SUCCESS, In, Out, StatefulAction, SubTree, Tree, TreeLoadError
from bestman_bt.facts.predicate import Beliefs
from bestman_bt.registry import PREDICATES, UnknownNameError
from bestman_bt.task_planning.base import TaskPlanner, made_planner
from bestman_bt.task_planning.builders.base import made_builder
from bestman_bt.task_planning.builders.plan_tree import PlanTree, sequential_steps
from bestman_bt.task_planning.builders.regression import Kernel, ready_steps
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.limits import PlanLimits, plan_within
from bestman_bt.task_planning.state import holds
from bestman_bt.task_planning.symbolic.facts import parse_literals
from bestman_bt.task_planning.symbolic.problem import (
    Action,
    Fact,
    GoalError,
    Literal,
    PlanningError,
    PlanningProblem,
    TaskPlan,
    Unsolvable,
)
from bestman_bt.task_planning.verification import verify

TUCKED = 0.1
"""Radians by which the joints of a tucked arm may be off its posture."""


class Holds(SkillCondition):
    """Check whether facts are believed: ``on(mug, table/top) and not open(fridge/upper_door)``.

    ``{object}``, ``{place}`` and ``{container}`` in the text refer to the ports of these names.
    """

    USES = ("arm",)
    fact = In(str, "facts, joined by and")
    object = In[str | None](ObjectName, "for {object} in the fact", required=False)
    place_ = In[str | None](SurfaceName, "for {place} in the fact", required=False, port="place")
    container = In[str | None](ArticulationName, "for {container} in the fact", required=False)
    FAILS: ClassVar = {
        "not_believed": "achieve it: Plan, ExecutePlan",
        "unknown_name": "use the names of the map",
    }

    _achievable: frozenset[str] | None = None

    def check(self) -> tuple[str, str] | None:
        """Check the belief, without an image."""
        values = {"{object}": self.object, "{place}": self.place_, "{container}": self.container}
        beliefs = beliefs_of(self.skills)
        try:
            for literal in parse_literals(self.fact):
                asked = literal.bound({port: name for port, name in values.items() if name})
                if holds(beliefs, asked.fact, self._declared(asked.fact.predicate)) == asked.negated:
                    return "not_believed", f"it is not believed that {asked}"
        except GoalError as error:
            return "bad_input", str(error)
        except (UnknownNameError, KeyError) as error:
            return "unknown_name", str(error.args[0])
        return None

    def _declared(self, predicate: str) -> frozenset[str]:
        """Return the predicates of abilities; they are looked up only for an undeclared one."""
        if self._achievable is None and predicate not in PREDICATES.names():
            self._achievable = frozenset(Domain.of(self.owner.registry).signatures)
        return self._achievable or frozenset()


def beliefs_of(skills: SkillContext) -> Beliefs:
    """Return the beliefs of a running robot, with the arm's state from encoders; without an arm it counts as tucked."""
    if not skills.has("arm"):
        return Beliefs(skills.world, tucked=True)
    posture = skills.robot.posture(DRIVEN, skills.arm_model.joint_names)
    off = float(np.abs(skills.arm_positions() - posture).max())
    return Beliefs(skills.world, tucked=off <= TUCKED)


@dataclass(frozen=True)
class PlanAssessment:
    """The state of a plan; ``next``: the next action, None if the plan is complete or no longer leads to the goal.

    ``broken``: the violated conditions of the rest of the plan, if it no longer helps.
    """

    done: bool
    next: Action | None
    broken: tuple[Literal, ...] = ()

    def __str__(self) -> str:
        if self.done:
            return "the goal holds"
        if self.next is not None:
            return f"next is {self.next}"
        return f"the plan no longer helps: it needs {' and '.join(map(str, self.broken))}"


class PlanMonitor:
    """Determines which part of a plan leads to the goal from a given state."""

    def __init__(self, plan: TaskPlan, goal: Iterable[Literal], most_ways: int = 8) -> None:
        self._goal = frozenset(goal)
        self._steps = ready_steps(sequential_steps(plan), self._goal, most_ways)

    def assess(self, state: Collection[Fact]) -> PlanAssessment:
        """Return the state of the plan for a state of the world."""
        if not _broken(self._goal, state):
            return PlanAssessment(True, None)
        ready = [each.step for each in self._steps if each.holds_in(state)]
        if ready:
            return PlanAssessment(False, ready[-1].actions[0])
        ways = [self._goal, *(way for each in self._steps for way in each.ways)]
        return PlanAssessment(False, None, min((_broken(way, state) for way in ways), key=len))


def _broken(way: Kernel, state: Collection[Fact]) -> tuple[Literal, ...]:
    return tuple(sorted(literal for literal in way if not literal.holds_in(state)))


ANSWERS = frozenset({"not_believed", "other_code"})
"""Codes with which ``Holds`` and ``AreErrorCodesPresent`` report a negative result, which is not the cause of a
failure.
"""


class _Planning(RobotNode):
    """The description of the task that both leaves share."""

    goal = In(str, "facts, joined by and: on(mug, table) and closed(drawer_chest/drawer_3)")

    def domain_and_problem(self) -> tuple[Domain, PlanningProblem]:
        """Return the domain, and the problem of the current beliefs and goal. Raises SkillFailure (``bad_goal``)."""
        domain = Domain.of(self.owner.registry)
        try:
            return domain, domain.problem(beliefs_of(self.skills), self.goal)
        except GoalError as error:
            raise SkillFailure("bad_goal", str(error)) from error


class Plan(_Planning, Skill):
    """Plan from the current beliefs; on failure (``unsolvable``) the message names the missing facts."""

    USES = ("arm",)
    planner = In(str, "symbolic, fast_downward, or one of your own", default="symbolic")
    limits = In(PlanLimits, "for a plan: steps=20; only=PickUp; without=fridge", default=PlanLimits())
    plan = Out(TaskPlan, "the actions", required=True)
    FAILS: ClassVar = {
        "bad_goal": "correct the goal",
        "unknown_name": "name a registered planner or builder",
        "no_plan": "ask for less, or with other limits",
        "unsolvable": "ask for something that can be reached: the message names what no action achieves",
    }

    def execute(self) -> SkillCoroutine[None]:
        """Compute a plan, log it and write it to the port."""
        try:
            planner = made_planner(self.planner)
        except UnknownNameError as error:
            raise SkillFailure("unknown_name", str(error)) from error
        except PlanningError as error:
            raise SkillFailure("no_plan", str(error)) from error
        _, problem = self.domain_and_problem()
        plan: TaskPlan = yield self.compute("task_planning", _plan, planner, problem, self.limits)
        self.plan = plan
        self.feedback_message = "; ".join(str(action) for action in plan.actions) or "the goal is believed already"


class ExecutePlan(_Planning, ErrorReporting, StatefulAction):
    """Build a tree from a plan, check it, and tick it; FAILURE if the plan fails or no longer helps.

    The tree has its own blackboard: it shares the robot and the beliefs, but no entries.
    """

    USES = ("arm",)
    plan = In(TaskPlan, "the actions, from Plan")
    builder = In(str, "sequence, reactive or backchain", default="reactive")

    _tree: Tree | None = None
    _monitor: PlanMonitor
    _failures_before: int
    FAILS: ClassVar = {
        "bad_goal": "correct the goal",
        "unknown_name": "name a registered planner or builder",
        "bad_plan": "Plan again",
        "refused": "the plan fails in a dry run: Plan again",
        "plan_failed": "look at what has changed, then Plan again",
    }

    def on_start(self) -> int:
        """Build and check the tree before anything moves."""
        self._failures_before = len(self.skills.failures)
        try:
            domain, problem = self.domain_and_problem()
            plan = self.plan
            self._monitor = PlanMonitor(plan, problem.goal_literals)
            self._tree = self._checked(self._built(domain, problem, plan), problem)
            self.owner.announce_inner(self._tree, self)
        except SkillFailure as failure:
            return self.explain_error(failure)
        except PlanningError as error:
            return self.explain("bad_plan", str(error))
        return self.on_running()

    def on_running(self) -> int:
        """Tick the tree of the plan."""
        tree = self._tree
        assert tree is not None
        status = tree.tick_once()
        if status == RUNNING:
            self.feedback_message = _running_ability(tree)
            return RUNNING
        self._tree = None
        if status == SUCCESS:
            return self.succeed("the goal is believed")
        return self.explain("plan_failed", self._why())

    def on_halted(self) -> None:
        """Halt the tree of the plan."""
        if self._tree is not None:
            self._tree.halt()
            self._tree = None

    def _built(self, domain: Domain, problem: PlanningProblem, plan: TaskPlan) -> PlanTree:
        try:
            builder = made_builder(self.builder)
        except UnknownNameError as error:
            raise SkillFailure("unknown_name", str(error)) from error
        return builder.build(plan, problem.goal_literals, [one.name for one in domain.abilities if not one.is_subtree])

    def _checked(self, made: PlanTree, problem: PlanningProblem) -> Tree:
        registry, skills = self.owner.registry, self.skills
        faults = verify(made.document().to_xml(), problem, registry, skills.robot, skills.world)
        refusals = [str(fault) for fault in faults if fault.severity != "warning"]
        if refusals:
            raise SkillFailure("refused", "; ".join(refusals))
        try:
            return made.load(registry, context=self.context, clock=self.clock)
        except TreeLoadError as error:
            raise SkillFailure("refused", str(error)) from error

    def _why(self) -> str:
        """Return the message of the last failed skill, and the state of the plan."""
        _, problem = self.domain_and_problem()
        failed = [
            failure for failure in self.skills.failures[self._failures_before :] if failure.error_code not in ANSWERS
        ]
        said = [f"{failure.where or failure.node}: {failure.why}" for failure in failed[-1:]]
        return "; ".join([*said, str(self._monitor.assess(problem.state))])


def _plan(planner: TaskPlanner, problem: PlanningProblem, limits: PlanLimits) -> TaskPlan:
    """Return a plan. Raises SkillFailure with the reason."""
    try:
        return plan_within(planner, problem, limits)
    except Unsolvable as error:
        raise SkillFailure("unsolvable", str(error)) from error
    except PlanningError as error:
        raise SkillFailure("no_plan", str(error)) from error


def _running_ability(tree: Tree) -> str:
    """Return the current abilities: the outermost running subtrees or leaves."""
    running = [
        node for node in tree.nodes if node.state == RUNNING and (isinstance(node, SubTree) or not node.children)
    ]
    return ", ".join(node.name for node in running if node.place is not None and node.place.prefix == "")
