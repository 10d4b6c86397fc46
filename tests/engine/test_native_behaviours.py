"""Native py_trees behaviours in our trees: every class of the library, with life cycle, clock and states."""

from __future__ import annotations

import inspect
import operator
import re
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import py_trees
import pytest
from py_trees import behaviours, composites, decorators, idioms, timers
from py_trees.behaviour import Behaviour
from py_trees.common import ComparisonExpression, OneShotPolicy, ParallelPolicy, Status

from bestman_bt.engine import (
    FAILURE,
    RUNNING,
    SUCCESS,
    AlwaysSuccess,
    EngineError,
    ManualClock,
    NodeError,
    ReactiveSequence,
    Script,
    ScriptCondition,
    Sequence,
    StatefulAction,
    SubTree,
    Tree,
    TreeLoadError,
    build_tree,
    load_tree,
    render_text,
)
from bestman_bt.records.described_tree import describe_tree


@pytest.fixture(autouse=True)
def _own_py_trees_blackboard() -> Any:
    yield
    py_trees.blackboard.Blackboard.clear()
    py_trees.blackboard.Blackboard.metadata.clear()


def equal(name: str, value: Any) -> ComparisonExpression:
    return ComparisonExpression(name, value, operator.eq)


class Skill(StatefulAction):
    """RUNNING once; keeps what the tree's context is."""

    def on_load(self) -> None:
        self.seen: list[Any] = []
        self.halts = 0

    def on_start(self) -> int:
        self.seen.append(self.context)
        return RUNNING

    def on_running(self) -> int:
        return SUCCESS

    def on_halted(self) -> None:
        self.halts += 1


Make = Callable[[], Behaviour]
LEAVES: dict[str, Make] = {
    "Success": lambda: behaviours.Success("b"),
    "Failure": lambda: behaviours.Failure("b"),
    "Running": lambda: behaviours.Running("b"),
    "Dummy": lambda: behaviours.Dummy("b"),
    "Periodic": lambda: behaviours.Periodic("b", 1),
    "StatusQueue": lambda: behaviours.StatusQueue("b", [Status.RUNNING, Status.SUCCESS], None),
    "SuccessEveryN": lambda: behaviours.SuccessEveryN("b", 2),
    "TickCounter": lambda: behaviours.TickCounter("b", 1, Status.SUCCESS),
    "BlackboardToStatus": lambda: behaviours.BlackboardToStatus("b", "status"),
    "CheckBlackboardVariableExists": lambda: behaviours.CheckBlackboardVariableExists("b", "known"),
    "WaitForBlackboardVariable": lambda: behaviours.WaitForBlackboardVariable("b", "known"),
    "UnsetBlackboardVariable": lambda: behaviours.UnsetBlackboardVariable("b", "known"),
    "SetBlackboardVariable": lambda: behaviours.SetBlackboardVariable("b", "written", 3, True),
    "CheckBlackboardVariableValue": lambda: behaviours.CheckBlackboardVariableValue("b", equal("known", 7)),
    "CompareBlackboardVariables": lambda: behaviours.CompareBlackboardVariables("b", "known", "known", operator.eq),
    "WaitForBlackboardVariableValue": lambda: behaviours.WaitForBlackboardVariableValue("b", equal("known", 7)),
    "CheckBlackboardVariableValues": lambda: behaviours.CheckBlackboardVariableValues(
        "b", [equal("known", 7), equal("known", 8)], operator.or_
    ),
    "ProbabilisticBehaviour": lambda: behaviours.ProbabilisticBehaviour("b", [0.0, 1.0, 0.0]),
    "Timer": lambda: timers.Timer("b", 0.15),
}
COMPOSITES: dict[str, Callable[[list[Behaviour]], Behaviour]] = {
    "Sequence": lambda children: composites.Sequence("b", memory=True, children=children),
    "Selector": lambda children: composites.Selector("b", memory=False, children=children),
    "Parallel": lambda children: composites.Parallel("b", ParallelPolicy.SuccessOnAll(), children=children),
}
DECORATORS: dict[str, Callable[[Behaviour], Behaviour]] = {
    "Repeat": lambda child: decorators.Repeat("b", child, 2),
    "Retry": lambda child: decorators.Retry("b", child, 2),
    "StatusToBlackboard": lambda child: decorators.StatusToBlackboard(name="b", child=child, variable_name="written"),
    "EternalGuard": lambda child: decorators.EternalGuard(name="b", child=child, condition=lambda: True),
    "Timeout": lambda child: decorators.Timeout("b", child, 0.15),
    "Count": lambda child: decorators.Count("b", child),
    "OneShot": lambda child: decorators.OneShot("b", child, OneShotPolicy.ON_COMPLETION),
    "Condition": lambda child: decorators.Condition("b", child, Status.SUCCESS),
    "ForEach": lambda child: decorators.ForEach("b", child, "items", "item"),
    **{
        name: partial(getattr(decorators, name), "b")
        for name in (
            "Inverter", "RunningIsFailure", "RunningIsSuccess", "FailureIsSuccess", "FailureIsRunning",
            "SuccessIsFailure", "SuccessIsRunning", "PassThrough",
        )
    },
}  # fmt: skip
IDIOMS: dict[str, Callable[[Behaviour, Behaviour], Behaviour]] = {
    "pick_up_where_you_left_off": lambda a, b: idioms.pick_up_where_you_left_off("b", [a, b]),
    "either_or": lambda a, b: idioms.either_or([equal("/known", 7), equal("/known", 8)], [a, b], "b", "chosen"),
    "oneshot": lambda a, b: idioms.oneshot(composites.Sequence("two", True, [a, b]), "b", "done"),
}


def classes(module: Any, but: tuple[str, ...] = ()) -> set[str]:
    found = inspect.getmembers(module, inspect.isclass)
    return {name for name, cls in found if cls.__module__ == module.__name__ and name not in but}


def test_the_lists_of_this_file_are_what_is_installed() -> None:
    assert LEAVES.keys() == classes(behaviours) | {"Success", "Failure", "Running", "Dummy", "Timer"}
    assert COMPOSITES.keys() == classes(composites, ("Composite",))
    assert DECORATORS.keys() == classes(decorators, ("Decorator",))
    functions = inspect.getmembers(idioms, inspect.isfunction)
    assert IDIOMS.keys() == {name for name, found in functions if found.__module__ == idioms.__name__}


def prepared() -> None:
    for name, value in (("known", 7), ("status", Status.SUCCESS), ("items", ["a", "b"])):
        py_trees.blackboard.Blackboard.set(name, value)


def native_course(root: Behaviour, ticks: int) -> list[tuple[str, ...]]:
    """The states of a native tree, children before parents, tick by tick."""
    course = []
    for _ in range(ticks):
        root.tick_once()
        course.append(tuple(node.status.name for node in root.iterate()))
    return course


def counter() -> Behaviour:
    return behaviours.TickCounter("a", 1, Status.SUCCESS)


def made(name: str, first: Behaviour, second: Behaviour) -> Behaviour:
    """The behaviour of this name, around these two; a decorator around the first."""
    if name in LEAVES:
        return LEAVES[name]()
    if name in COMPOSITES:
        return COMPOSITES[name]([first, second])
    return DECORATORS[name](first) if name in DECORATORS else IDIOMS[name](first, second)


@pytest.mark.parametrize("name", sorted(LEAVES | COMPOSITES | DECORATORS | IDIOMS))
def test_a_native_class_gives_in_our_tree_what_it_gives_alone(name: str) -> None:
    prepared()
    alone = made(name, counter(), behaviours.Success("c"))
    expected = [states[-1] for states in native_course(alone, 4)]
    py_trees.blackboard.Blackboard.clear()
    prepared()
    root = made(name, counter(), behaviours.Success("c"))
    tree = build_tree(ReactiveSequence("ours", [root]), clock=ManualClock())
    given = []
    for _ in range(4):
        tree.tick_exactly_once()
        given.append(root.status.name)
    if name not in ("Timer", "Timeout"):  # their time is the tree's, which stands still here
        assert given == expected
    below = [node.name for node in root.iterate()]
    assert sorted(n.name for n in tree.nodes[1:]) == sorted(" ".join(found.split()) for found in below)
    tree.halt()
    tree.shutdown()


@pytest.mark.parametrize("name", sorted(COMPOSITES | DECORATORS | IDIOMS))
def test_our_skills_get_their_context_inside_native_parents_and_are_halted_with_them(name: str) -> None:
    prepared()
    skill, other = Skill("skill"), AlwaysSuccess("other")
    tree = build_tree(ReactiveSequence("ours", [made(name, skill, other)]), clock=ManualClock(), context="robot")
    tree.tick_exactly_once()
    assert skill.seen == ["robot"]
    if not name.startswith("RunningIs"):  # these stop a child that runs, at once
        assert (skill.state, skill.halts) == (RUNNING, 0)
    tree.halt()
    assert (skill.state, skill.halts) == (0, 1)


class Device(Behaviour):
    """Writes down its life."""

    def __init__(self, name: str, log: list[Any]) -> None:
        super().__init__(name)
        self.log = log

    def setup(self, **kwargs: Any) -> None:
        self.log.append(("setup", self.name, kwargs))

    def update(self) -> Status:
        self.log.append(("update", self.name))
        return Status.SUCCESS

    def shutdown(self) -> None:
        self.log.append(("shutdown", self.name))


def test_setup_comes_once_before_the_first_tick_with_context_and_clock_and_shutdown_at_the_end() -> None:
    log: list[Any] = []
    clock = ManualClock()
    tree = build_tree(
        Sequence([composites.Sequence("s", True, [Device("a", log)]), Device("b", log)]), context="robot", clock=clock
    )
    assert log == []
    tree.tick_exactly_once()
    tree.tick_exactly_once()
    given = {"context": "robot", "clock": clock}
    ticks = [("update", "a"), ("update", "b")]
    assert log == [("setup", "a", given), ("setup", "b", given), *ticks, *ticks]
    tree.shutdown()
    tree.shutdown()
    assert log[6:] == [("shutdown", "a"), ("shutdown", "b")]


def test_setup_can_be_called_with_arguments_and_a_signature_without_them_is_respected() -> None:
    class Plain(Device):
        def setup(self) -> None:
            self.log.append("plain")

    log: list[Any] = []
    tree = build_tree(Device("a", log), context="robot", clock=(clock := ManualClock()))
    tree.setup(timeout=1.0, node="ros")
    tree.tick_exactly_once()
    assert log == [("setup", "a", {"context": "robot", "clock": clock, "node": "ros"}), ("update", "a")]
    log.clear()
    build_tree(Plain("b", log)).tick_exactly_once()
    assert log == ["plain", ("update", "b")]


def test_a_setup_that_fails_or_hangs_is_an_error_with_the_node_and_nothing_is_ticked() -> None:
    class Broken(Device):
        def setup(self, **kwargs: Any) -> None:
            raise OSError("no device at /dev/ttyUSB0")

    class Hangs(Device):
        def setup(self, **kwargs: Any) -> None:
            time.sleep(5)

    log: list[Any] = []
    with pytest.raises(NodeError, match=r"gripper .*setup\(\) failed: no device at /dev/ttyUSB0"):
        build_tree(Sequence([Device("a", log), Broken("gripper", log)])).tick_exactly_once()
    assert [entry[0] for entry in log] == ["setup"]
    with pytest.raises(NodeError, match=r"node slow .*timed out"):
        build_tree(Hangs("slow", log)).setup(timeout=0.05)


def test_setup_works_outside_the_main_thread() -> None:
    log: list[Any] = []
    tree = build_tree(Device("a", log))
    thread = threading.Thread(target=tree.tick_exactly_once)
    thread.start()
    thread.join()
    assert [entry[0] for entry in log] == ["setup", "update"]


def test_all_are_shut_down_though_one_fails() -> None:
    class Sticks(Device):
        def shutdown(self) -> None:
            raise OSError("port busy")

    log: list[Any] = []
    tree = build_tree(Sequence([Sticks("a", log), Device("b", log)]))
    tree.tick_exactly_once()
    with pytest.raises(EngineError, match=r"node a .*shutdown\(\) failed: port busy"):
        tree.shutdown()
    assert log[-1] == ("shutdown", "b")


def test_native_timers_and_timeouts_follow_the_trees_clock() -> None:
    clock = ManualClock()
    tree = build_tree(timers.Timer("wait", 30.0), clock=clock)
    assert tree.tick_while_running(period=1.0) == SUCCESS
    assert clock.now() == 31.0  # it succeeds after its time, not at it
    tree = build_tree(decorators.Timeout("limit", behaviours.Running("work"), 30.0), clock=clock)
    assert tree.tick_while_running(period=1.0) == FAILURE
    assert clock.now() == 62.0


def test_outside_of_trees_native_timers_read_the_wall_clock() -> None:
    build_tree(timers.Timer("other", 30.0), clock=ManualClock())
    before = time.time()
    timer = timers.Timer("wait", 30.0)
    timer.tick_once()
    assert timer.finish_time >= before + 30.0


def guarded() -> tuple[Tree, Behaviour]:
    native = composites.Selector(
        "choose", memory=False, children=[decorators.Inverter("not", behaviours.Success("yes")), Skill("work")]
    )
    return build_tree(Sequence("root", [native, AlwaysSuccess("last")]), clock=ManualClock()), native


def test_native_subtrees_are_shown_node_by_node_once() -> None:
    tree, _ = guarded()
    tree.tick_exactly_once()
    names = ["root", "choose", "not", "yes", "work", "last"]
    assert [node.name for node in tree.nodes] == names
    assert [node.name for node in describe_tree(tree).nodes] == names
    assert [line.split("'")[1] for line in render_text(tree).splitlines()] == names
    shown = py_trees.display.unicode_tree(tree.root, show_status=True)
    assert [line.strip() for line in shown.splitlines()] == [
        "{-} root [*]", "[o] choose [*]", "-^- not [✕] -- success -> failure", "--> yes [✓] -- success",
        "--> work [*]", "--> last [-]",
    ]  # fmt: skip
    kinds = {node.name: (node.type_id, node.KIND) for node in tree.nodes}
    assert kinds["choose"] == ("Selector", "Control")
    assert kinds["not"] == ("Inverter", "Decorator")


def test_states_of_native_nodes_are_reported_as_they_change() -> None:
    tree, _ = guarded()
    told: list[tuple[str, int]] = []
    tree.subscribe(lambda changes: told.extend((tree.nodes[uid - 1].name, state) for uid, state in changes))
    tree.tick_exactly_once()
    assert told == [("root", RUNNING), ("yes", SUCCESS), ("yes", 0), ("not", FAILURE), ("work", RUNNING),
                    ("choose", RUNNING)]  # fmt: skip
    told.clear()
    tree.tick_exactly_once()
    assert [entry for entry in told if entry[0] in ("work", "choose")] == [
        ("work", SUCCESS), ("work", 0), ("choose", SUCCESS), ("choose", 0),
    ]  # fmt: skip


def test_hooks_and_visitors_reach_native_nodes_below_native_parents() -> None:
    tree, _ = guarded()
    visitor = py_trees.visitors.SnapshotVisitor()
    tree.add_visitor(visitor)
    tree.node("yes").add_pre_tick(lambda node: FAILURE)
    assert tree.tick_exactly_once() == SUCCESS  # the Inverter now succeeds, without "yes" being ticked
    by_id = {node.id: node.name for node in tree.nodes}
    assert {by_id[key]: status.name for key, status in visitor.visited.items()} == {
        "yes": "FAILURE", "not": "SUCCESS", "choose": "SUCCESS", "last": "SUCCESS", "root": "SUCCESS",
    }  # fmt: skip


def test_a_behaviour_tree_ticks_interrupts_and_sets_up_native_nodes_with_handlers() -> None:
    log: list[Any] = []
    native = composites.Sequence("s", True, [Device("a", log), behaviours.Running("r"), Skill("never")])
    tree = build_tree(Sequence("root", [native]))
    custodian = py_trees.trees.BehaviourTree(tree.root)
    custodian.add_pre_tick_handler(lambda _: log.append("pre"))
    custodian.add_post_tick_handler(lambda _: log.append("post"))
    visitor = py_trees.visitors.SnapshotVisitor()
    custodian.add_visitor(visitor)
    custodian.setup(timeout=1.0, node="ros")
    custodian.tick()
    assert log[0][:2] == ("setup", "a")
    assert log[1:] == ["pre", ("update", "a"), "post"]
    assert native.status is Status.RUNNING
    assert len(visitor.visited) == 4
    assert custodian.tip().name == "r"
    custodian.tick_tock(1, 100, post_tick_handler=lambda found: found.interrupt())
    assert custodian.count == 2
    tree.root.stop(Status.INVALID)
    assert [node.status for node in native.iterate()] == [Status.INVALID] * 4
    assert {node.state for node in tree.nodes} == {0}
    custodian.shutdown()
    assert log[-1] == ("shutdown", "a")


def test_an_error_in_a_native_leaf_names_the_leaf() -> None:
    class Breaks(Behaviour):
        def update(self) -> Status:
            raise ZeroDivisionError("by nothing")

    tree = build_tree(composites.Sequence("s", True, [Breaks("leaf")]))
    with pytest.raises(NodeError, match="node leaf .*by nothing"):
        tree.tick_exactly_once()


OWN_LEAVES = """import py_trees
from bestman_bt.engine import Sequence

class Fails(py_trees.behaviour.Behaviour):
    def __init__(self, name):
        super().__init__(name)

    def update(self):
        return py_trees.common.Status.FAILURE

LEFT = py_trees.behaviours.Failure("left")

def build():
    idiom = py_trees.idioms.oneshot(Fails("once"), "done", "key", py_trees.common.OneShotPolicy.ON_COMPLETION)
    return Sequence(
        [LEFT, py_trees.decorators.Inverter("not", Fails("inner")), idiom],
    )
"""


def test_native_nodes_are_called_by_the_line_that_makes_them(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN_LEAVES)
    made_by, tree = Behaviour.__init__, load_tree(tmp_path / "own.py")
    assert [tree.node(name).where for name in ("left", "not", "inner", "once", "done")] == [
        "left (own.py:11)",
        "not (own.py:16)",
        "inner (own.py:16)",
        "once (own.py:14)",
        "done (own.py:14)",
    ]
    assert Behaviour.__init__ is made_by


def test_a_native_leaf_that_a_script_has_made_is_called_by_the_line_of_its_class() -> None:
    class Breaks(Behaviour):
        def update(self) -> Status:
            return Status.FAILURE

    tree = build_tree(Sequence([Breaks("own"), behaviours.Failure("theirs")]))
    line = Breaks.update.__code__.co_firstlineno
    assert [tree.node(name).where.partition(":")[2] for name in ("own", "theirs")] == [f"{line})", ""]


def test_a_native_behaviour_belongs_to_one_tree() -> None:
    native = behaviours.Success("only")
    build_tree(native)
    with pytest.raises(TreeLoadError, match="'only' is part of a tree already"):
        build_tree(native)


PICK = """<root BTCPP_format="4" main_tree_to_execute="Pick">
<BehaviorTree ID="Pick"><Sequence><Script code="held := target"/><SubTree ID="Then"/></Sequence></BehaviorTree>
<BehaviorTree ID="Then"><AlwaysSuccess name="done"/></BehaviorTree></root>"""


def test_a_loaded_xml_tree_stands_inside_a_python_one_with_its_values() -> None:
    loaded = load_tree(PICK)
    loaded.blackboard["target"] = "cup"
    tree = build_tree(ReactiveSequence("guard", [ScriptCondition(code="true"), loaded]))
    assert tree.tick_exactly_once() == SUCCESS
    assert [node.name for node in tree.nodes][2:] == ["Pick", "Sequence", "Script", "Then", "done"]
    assert tree.blackboards["Pick::3"]["held"] == "cup"
    assert 'ID="Pick"' in tree.xml


def test_a_subtree_reads_an_xml_file_and_maps_its_ports(tmp_path: Path) -> None:
    file = tmp_path / "pick.xml"
    file.write_text(PICK)
    tree = build_tree(Sequence([Script(code="cup := 'mug'"), SubTree(file, target="{cup}", held="{got}")]))
    assert tree.tick_exactly_once() == SUCCESS
    assert tree.blackboard["got"] == "mug"
    file.write_text(PICK.replace("AlwaysSuccess", "AlwaysSucess"))
    with pytest.raises(TreeLoadError, match=r"pick.xml.*AlwaysSucess"):
        build_tree(SubTree(file))


def test_a_tree_made_in_python_cannot_be_taken_for_a_loaded_one() -> None:
    with pytest.raises(TreeLoadError, match="give SubTree the function"):
        build_tree(Sequence([build_tree(AlwaysSuccess())]))


def test_a_build_may_return_a_native_root_or_a_loaded_tree(tmp_path: Path) -> None:
    file = tmp_path / "tree.py"
    file.write_text("import py_trees\ndef build():\n    return py_trees.behaviours.Success('yes')\n")
    assert load_tree(file).tick_exactly_once() == SUCCESS
    (tmp_path / "pick.xml").write_text(PICK.replace("target", "1"))
    file.write_text(
        "from pathlib import Path\nfrom bestman_bt.engine import load_tree\n"
        "def build():\n    return load_tree(Path(__file__).with_name('pick.xml'))\n"
    )
    assert load_tree(file).tick_exactly_once() == SUCCESS


def test_the_documented_tree_of_py_trees_behaviours_runs() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "writing_a_tree.md").read_text()
    code = re.search(r"```python\n(import py_trees\n.*?)```", page, re.DOTALL)
    assert code is not None
    names: dict[str, Any] = {}
    exec(compile(code.group(1), "writing_a_tree.md", "exec"), names)
    tree = build_tree(names["build"](), context="robot", clock=ManualClock())
    assert tree.tick_while_running() == SUCCESS
    assert (tree.blackboard["steps"], tree.node("count").feedback_message) == (3, "3 steps")
    tree.shutdown()
