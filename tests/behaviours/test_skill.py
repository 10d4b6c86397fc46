"""What every skill owes its tree: it waits without blocking, tells why it failed, and cleans up."""

from __future__ import annotations

import inspect
import math
from typing import Any, ClassVar

import pytest
from py_trees.ports import PortInformation

from behaviours.contacts import Contact, grasp, handle, push, support
from behaviours.skill import Declaration, Skill, SkillCondition, SkillCoroutine, SkillFailure
from bestman_bt.engine import FAILURE, RUNNING, SUCCESS, In, Node, NodeError, Tree, build_tree, load_tree
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.runtime.robot_session import RobotSession
from hal.simulation.sensor_pipeline import SensorFault
from tests.behaviours.at_the_table import PERIOD, failures_of, tick, tree_of
from tests.behaviours.test_doors_seen import door_and_handle


class Think(Skill):
    """Computes for ``detection``'s cost; fails with what the port says."""

    INPUT_PORTS: ClassVar = {"trouble": PortInformation(str, required=False, default_value="")}
    OUTPUT_PORTS: ClassVar = {"answer": PortInformation(int, required=False)}

    def execute(self) -> SkillCoroutine[None]:
        answer = yield self.compute("detection", self._think, self.get_input("trouble"))
        self.set_output("answer", answer)
        self.feedback_message = "thought it over"

    def _think(self, trouble: str) -> int:
        match trouble:
            case "no way":
                raise ManipulationError("there is no way")
            case "lost":
                raise SkillFailure("lost", "where am I")
            case "bug":
                raise ZeroDivisionError("a mistake in the code")
        return 42


class Feel(Skill):
    """Reads the wrist."""

    def execute(self) -> SkillCoroutine[None]:
        assert self.skills.wrist_wrench is not None
        self.skills.wrist_wrench.contact()
        yield from ()


class Felt(SkillCondition):
    """Reads the wrist, too."""

    def check(self) -> tuple[str, str] | None:
        assert self.skills.wrist_wrench is not None
        self.skills.wrist_wrench.contact()
        return None


class Compared(SkillCondition):
    """Reads numbers, one by one or in a list."""

    INPUT_PORTS: ClassVar = {
        "limit": PortInformation(float, required=False, default_value=0.0),
        "limits": PortInformation(list, required=False),
    }

    def check(self) -> tuple[str, str] | None:
        self.get_input("limits")
        return ("above", "it is above the limit") if self.get_input("limit") < 0.0 else None


class Tidy(Skill):
    """Turns the head and notes when its ``finally`` clause ran."""

    tidied = False

    def execute(self) -> SkillCoroutine[None]:
        try:
            yield self.skills.head.move_to([0.8, 0.8])
        finally:
            self.tidied = True


class TryTwice(Skill):
    """Goes on after a controller that fails."""

    def execute(self) -> SkillCoroutine[None]:
        try:
            yield self.skills.head.look_at([-1.0, 0.0, 0.0])
        except SkillFailure as failure:
            self.feedback_message = f"not there: {failure.code}"
        yield self.skills.head.look_at([1.0, 0.0, 0.7])


class Reach(Skill):
    """Declares what it should not."""

    declared: Contact

    def execute(self) -> SkillCoroutine[None]:
        with self.touching(self.declared):
            yield self.skills.head.move_to([0.1, 0.1])


class Press(Skill):
    """Says what it touches, moves the head, and ends as the port says; remarks on it the first time only."""

    INPUT_PORTS: ClassVar = {"fails": PortInformation(bool, required=False, default_value=False)}
    remarked = False

    def execute(self) -> SkillCoroutine[None]:
        with self.touching(Contact("handle", "fridge/upper_door", 50.0)):
            yield self.skills.head.move_to([0.1, 0.1])
            if self.get_input("fails"):
                raise SkillFailure("too_hard", "it does not give way")
        if not self.remarked:
            self.remarked, self.feedback_message = True, "it gave way"


def load(robot: RobotSession, body: str) -> Tree:
    for leaf in (Think, Feel, Felt, Compared, Tidy, TryTwice, Press, Reach):
        if leaf.__name__ not in robot.setup.registry:
            robot.setup.registry.register(leaf)
    return robot.load(tree_of(body))


def leaf_of(tree: Tree, kind: type[Node]) -> Any:
    return next(node for node in tree.nodes if isinstance(node, kind))


def test_a_computation_keeps_its_skill_running_for_its_cost(bystander: RobotSession) -> None:
    tree = load(bystander, '<Think answer="{answer}"/>')
    start = bystander.robot.clock.now()
    assert tick(tree, 100) == SUCCESS
    cost = bystander.skills.costs["detection"]
    assert cost <= bystander.robot.clock.now() - start < cost + 1.5 * PERIOD
    assert tree.blackboard.get("answer") == 42


def test_code_and_words_of_a_failure_are_written_and_success_clears_them(bystander: RobotSession) -> None:
    tree = load(bystander, '<Think trouble="{trouble}" error_code="{code}" error_message="{words}"/>')
    tree.blackboard.set("trouble", "lost")
    assert tick(tree, 100) == FAILURE
    assert (tree.blackboard.get("code"), tree.blackboard.get("words")) == ("lost", "where am I")
    assert leaf_of(tree, Think).feedback_message == "where am I"
    tree.blackboard.set("trouble", "none")
    assert tick(tree, 100) == SUCCESS
    assert (tree.blackboard.get("code"), tree.blackboard.get("words")) == ("", "")
    assert leaf_of(tree, Think).feedback_message == "thought it over"


def test_an_algorithm_that_finds_nothing_fails_the_skill(bystander: RobotSession) -> None:
    assert tick(load(bystander, '<Think trouble="no way"/>'), 100) == FAILURE
    assert failures_of(bystander) == [("failed", "there is no way")]


@pytest.mark.parametrize("leaf", ["Feel", "Felt"])
def test_a_silent_sensor_fails_whoever_reads_it(bystander: RobotSession, leaf: str) -> None:
    sensor = bystander.robot.parts["wrist_force_torque"]
    assert tick(load(bystander, f"<{leaf}/>"), 50) == SUCCESS
    sensor.fault = SensorFault.SILENT
    try:
        assert tick(load(bystander, f"<{leaf}/>"), 50) == FAILURE
    finally:
        sensor.fault = None
    ((code, words),) = failures_of(bystander)
    assert code == "no_data"
    assert "wrist_force_torque" in words


def test_a_leaf_that_needs_silent_encoders_fails_with_a_code(bystander: RobotSession) -> None:
    encoders = bystander.robot.encoders("arm")
    encoders.fault = SensorFault.SILENT
    try:
        assert tick(load(bystander, '<MoveArm posture="home"/>'), 50) == FAILURE
    finally:
        encoders.fault = None
    ((code, words),) = failures_of(bystander)
    assert (code, bystander.skills.failures[-1].part) == ("no_data", "arm")
    assert "arm (encoders) delivers no readings" in words


@pytest.mark.parametrize(
    "limits", [[0.0, math.nan], [[1.0], [math.nan]], [(1.0, math.nan)]], ids=["flat", "nested", "in a tuple"]
)
def test_a_condition_refuses_a_number_that_is_none_in_a_list_too(bystander: RobotSession, limits: Any) -> None:
    assert tick(load(bystander, "<Compared/>"), 2) == SUCCESS
    tree = load(bystander, '<Compared limits="{limits}"/>')
    tree.blackboard.set("limits", limits)
    assert tick(tree, 2) == FAILURE
    assert [code for code, _ in failures_of(bystander)] == ["bad_input"]


def test_failures_are_recorded_in_their_order_with_path_and_time(bystander: RobotSession) -> None:
    body = '<Fallback name="all"><Think name="first" trouble="lost"/><Think name="second" trouble="no way"/></Fallback>'
    before = len(bystander.skills.failures)
    assert tick(load(bystander, body), 100) == FAILURE
    first, second = bystander.skills.failures[before:]
    assert (first.node, second.node) == ("first", "second")
    assert first.stamp < second.stamp <= bystander.robot.clock.now()


def test_a_mistake_in_a_skill_is_an_error_that_names_the_node_not_a_failure(bystander: RobotSession) -> None:
    tree = load(bystander, '<Think name="thinker" trouble="bug"/>')
    with pytest.raises(NodeError, match=r"thinker.*a mistake in the code"):
        tick(tree, 100)


def test_a_halt_cancels_what_the_skill_waits_for_and_runs_its_finally_clauses(bystander: RobotSession) -> None:
    tree = load(bystander, "<Tidy/>")
    assert tick(tree, 3) == RUNNING
    leaf = leaf_of(tree, Tidy)
    pending = leaf._pending
    assert not pending.done
    assert not leaf.tidied
    tree.halt()
    assert pending.done
    assert leaf.tidied


@pytest.mark.parametrize("end", ["success", "failure", "halt"])
def test_contacts_are_declared_as_long_as_the_work_lasts_however_it_ends(bystander: RobotSession, end: str) -> None:
    tree = load(bystander, f'<Press fails="{str(end == "failure").lower()}"/>')
    assert tick(tree, 1) == RUNNING
    assert [contact.skill for contact in bystander.skills.contacts] == [leaf_of(tree, Press).path]
    if end == "halt":
        tree.halt()
    else:
        assert tick(tree, 100) == (SUCCESS if end == "success" else FAILURE)
    assert bystander.skills.contacts == []


@pytest.mark.parametrize(
    ("declared", "words"),
    [
        (grasp("*"), "grasp: it should name one object that the robot knows, got '*'; known: "),
        (push("cupp"), "got 'cupp'; did you mean 'cup'?"),
        (support("", "table"), "got ''"),
        (handle("*"), "it should name one door or drawer, 'furniture/name', got '*'"),
        (grasp("cup", 601.0), "max_force should be more than 0 and at most 600 N, got 601"),
        (grasp("cup", math.nan), "max_force should be more than 0"),
    ],
)
def test_contacts_that_name_no_single_thing_or_too_much_force_are_refused(
    bystander: RobotSession, declared: Contact, words: str
) -> None:
    tree = load(bystander, "<Reach/>")
    leaf_of(tree, Reach).declared = declared
    with pytest.raises(NodeError) as raised:
        tree.tick_once()
    assert words in str(raised.value)
    assert f"(at {__file__}:" in str(raised.value)
    assert bystander.skills.contacts == []
    leaf_of(tree, Reach).declared = grasp("cup", 600.0)
    assert tree.tick_once() == RUNNING
    tree.halt()


def test_a_handle_is_one_of_the_map_where_the_map_has_doors_or_drawers(
    bystander: RobotSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    tree = load(bystander, "<Reach/>")
    reach = leaf_of(tree, Reach)
    reach.declared = handle("fridge/uper_door")
    assert tree.tick_once() == RUNNING, "the kitchen has neither, as a world that is explored"
    tree.halt()
    fridge = door_and_handle("fridge", "upper_door", 0.0)[0].furniture
    monkeypatch.setattr(bystander.skills.world, "map", bystander.skills.world.map.with_furniture(fridge))
    with pytest.raises(NodeError, match="map, got 'fridge/uper_door'; did you mean 'fridge/upper_door'"):
        tree.tick_once()
    assert bystander.skills.contacts == []
    reach.declared = handle("fridge/upper_door")
    assert tree.tick_once() == RUNNING
    tree.halt()


def test_what_a_skill_said_the_last_time_is_not_said_again(bystander: RobotSession) -> None:
    tree = load(bystander, "<Press/>")
    for told in ("it gave way", ""):
        assert tick(tree, 100) == SUCCESS
        assert leaf_of(tree, Press).feedback_message == told


def test_a_halted_skill_starts_anew(bystander: RobotSession) -> None:
    tree = load(bystander, '<Think answer="{answer}"/>')
    assert tick(tree, 2) == RUNNING
    tree.halt()
    assert tree.blackboard.get("answer") is None
    assert tick(tree, 100) == SUCCESS
    assert tree.blackboard.get("answer") == 42


def test_a_skill_may_go_on_after_a_controller_that_fails(bystander: RobotSession) -> None:
    tree = load(bystander, "<TryTwice/>")
    assert tick(tree, 100) == SUCCESS
    assert leaf_of(tree, TryTwice).feedback_message == "not there: unreachable"


def test_skills_report_what_context_they_need(bystander: RobotSession) -> None:
    tree = load_tree(tree_of('<MoveArm posture="carry"/>'), bystander.setup.registry, context="no robot")
    with pytest.raises(NodeError, match="skills need a SkillContext as the tree's context, not str"):
        tree.tick_once()


class NoYield(Skill):
    """A common mistake."""

    def execute(self) -> Any:
        return None


class YieldsFive(Skill):
    """Another, in a part of the skill."""

    def execute(self) -> Any:
        yield from self.part()

    def part(self) -> Any:
        yield 5


class HoldsTrue(SkillCondition):
    """A third."""

    def check(self) -> Any:
        return True


@pytest.mark.parametrize(
    ("leaf", "method", "words"),
    [
        (
            NoYield,
            NoYield.execute,
            "NoYield.execute should wait by yield, at least once (yield from ()); it has no yield",
        ),
        (YieldsFive, YieldsFive.part, "YieldsFive.execute should yield a Motion, as controllers and"),
        (HoldsTrue, HoldsTrue.check, "HoldsTrue.check should return None if it is true, else (code, why); got True"),
    ],
)
def test_mistakes_of_a_skills_author_are_reported_with_the_remedy_and_their_line(
    leaf: type[Node], method: Any, words: str
) -> None:
    tree = build_tree(leaf("mine"))
    with pytest.raises(NodeError) as raised:
        tree.tick_once()
    line = inspect.getsourcelines(method)[1] + (leaf is YieldsFive)
    assert words in str(raised.value)
    assert str(raised.value).endswith(f"(at {__file__}:{line})")


@pytest.mark.parametrize(
    ("declared", "told"),
    [
        ({"REQUIRES": ("hed",)}, r"Wrong.REQUIRES should be a tuple of kinds of parts \(base, lidar, .*got \('hed',\)"),
        ({"USES": "head"}, "Wrong.USES should be a tuple of kinds of parts .*got 'head'"),
        ({"FAILS": ["a"]}, r"Wrong.FAILS should map codes to advice for the tree, got \['a'\]"),
        ({"DECLARATION": 5}, "Wrong.DECLARATION should be a Declaration, got 5"),
        (
            {"thing": In(str), "DECLARATION": Declaration(effects=("on({thing}, {plcae})",), pre=("near({thing})",))},
            "Wrong.DECLARATION: effects name the port 'plcae', which the skill does not have; known: .*thing",
        ),
        ({"DECLARATION": Declaration(pre=("not on({thing})",))}, "pre name the port 'thing'"),
        (
            {"thing": In(str), "DECLARATION": Declaration(parameters={"thign": "object"})},
            "parameters name the port 'thign', .*did you mean 'thing'",
        ),
    ],
)
def test_a_wrong_declaration_is_refused_when_the_class_is_made(declared: dict[str, object], told: str) -> None:
    with pytest.raises(TypeError, match=told):
        type("Wrong", (Skill,), declared)
