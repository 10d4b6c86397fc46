"""Trees made in Python behave as their XML does, and go through XML and back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import py_trees
import pytest

from bestman_bt.engine import (
    FAILURE,
    RUNNING,
    SUCCESS,
    Fallback,
    Inverter,
    LoopString,
    ManualClock,
    NodeError,
    NodeRegistry,
    Parallel,
    PortInformation,
    Precondition,
    ReactiveSequence,
    RecoveryNode,
    RetryUntilSuccessful,
    Script,
    ScriptCondition,
    Sequence,
    StatefulAction,
    SubTree,
    Timeout,
    Tree,
    TreeLoadError,
    build_tree,
    load_tree,
    tree_to_xml,
)
from bestman_bt.engine.xml.writer import XmlError


class Move(StatefulAction):
    """RUNNING for ``ticks`` ticks."""

    INPUT_PORTS = {"ticks": PortInformation(int, False, "", 1), "to": PortInformation(list[float])}
    OUTPUT_PORTS = {"at": PortInformation(list[float], False)}

    def on_start(self) -> int:
        self.left = self.get_input("ticks")
        return RUNNING

    def on_running(self) -> int:
        self.left -= 1
        if self.left > 0:
            return RUNNING
        self.set_output("at", self.get_input("to"))
        return SUCCESS


def registry() -> NodeRegistry:
    found = NodeRegistry()
    found.register(Move)
    return found


def pick() -> Sequence:
    return Sequence(
        "pick",
        [
            Move("approach", to="{target}", ticks=2),
            Move(to="{target}", at="{held}", _onSuccess="count += 1"),
        ],
    )


def python_tree() -> Sequence:
    return Sequence(
        "fetch",
        [
            Script(code="count := 0; goal := '1;2'"),
            RetryUntilSuccessful(SubTree(pick, target="{goal}", held="{held}", count="{count}"), num_attempts=3),
            Timeout(
                Parallel([Move(to=[3.0, 4.0]), Inverter(Script(code="count += 1"))], success_count=1, failure_count=2),
                msec=900,
            ),
            Precondition(Move("again", to="{goal}"), if_="count == 2", else_="FAILURE"),
            LoopString(ScriptCondition(code="item != 'c'"), queue="a;b", value="{item}"),
            Fallback([SubTree(pick, name="second", target=[5.0, 6.0], count="{count}"), Script(code="late := 1")]),
            ReactiveSequence([ScriptCondition(code="count == 3"), Move(to="{goal}", _skipIf="late == 1")]),
        ],
    )


XML = """<root BTCPP_format="4" main_tree_to_execute="MainTree">
<BehaviorTree ID="MainTree"><Sequence name="fetch">
  <Script code="count := 0; goal := '1;2'"/>
  <RetryUntilSuccessful num_attempts="3">
    <SubTree ID="pick" target="{goal}" held="{held}" count="{count}"/>
  </RetryUntilSuccessful>
  <Timeout msec="900"><Parallel success_count="1" failure_count="2"><Move to="3.0;4.0"/>
    <Inverter><Script code="count += 1"/></Inverter></Parallel></Timeout>
  <Precondition if="count == 2" else="FAILURE"><Move name="again" to="{goal}"/></Precondition>
  <LoopString queue="a;b" value="{item}"><ScriptCondition code="item != 'c'"/></LoopString>
  <Fallback><SubTree ID="pick" name="second" target="5.0;6.0" count="{count}"/><Script code="late := 1"/></Fallback>
  <ReactiveSequence><ScriptCondition code="count == 3"/><Move to="{goal}" _skipIf="late == 1"/></ReactiveSequence>
</Sequence></BehaviorTree>
<BehaviorTree ID="pick"><Sequence name="pick">
  <Move name="approach" to="{target}" ticks="2"/><Move to="{target}" at="{held}" _onSuccess="count += 1"/>
</Sequence></BehaviorTree></root>"""


def trace(tree: Tree) -> list[Any]:
    events: list[Any] = [[(node.uid, node.path, node.type_id) for node in tree.nodes]]
    tree.subscribe(lambda changes: events.append((changes.stamp, list(changes))))
    try:
        events.append(tree.tick_while_running(0.1, max_ticks=100))
    except NodeError as error:  # they must be equal too, but for file and line
        events.append((error.node, error.reason))
    events.append([(path, board.keys()) for path, board in tree.blackboards.items()])
    return events


def test_a_python_tree_gives_the_same_events_as_its_xml() -> None:
    python = trace(build_tree(python_tree(), registry=registry(), clock=ManualClock()))
    xml = trace(load_tree(XML, registry(), clock=ManualClock()))
    assert len(python) > 10
    assert python == xml


def test_a_python_tree_exported_to_xml_gives_the_same_events() -> None:
    tree = build_tree(python_tree(), registry=registry(), clock=ManualClock())
    loaded = load_tree(tree_to_xml(tree), registry(), clock=ManualClock())
    assert trace(loaded) == trace(tree)


def test_an_exported_tree_exports_to_the_same_text_again() -> None:
    text = tree_to_xml(build_tree(python_tree(), registry=registry()))
    assert tree_to_xml(load_tree(text, registry())) == text
    assert text.count('<BehaviorTree ID="pick">') == 1


def test_subtrees_within_subtrees_keep_their_paths_through_an_export() -> None:
    text = """<root BTCPP_format="4" main_tree_to_execute="Main">
    <BehaviorTree ID="Main"><Sequence>
      <SubTree ID="Outer" name="first"/><SubTree ID="Outer"/><SubTree ID="Outer" name="last" a="{b}" _autoremap="true"/>
    </Sequence></BehaviorTree>
    <BehaviorTree ID="Outer"><Sequence name="body"><SubTree ID="Inner" name="named"/><SubTree ID="Inner"/></Sequence>
    </BehaviorTree>
    <BehaviorTree ID="Inner"><AlwaysSuccess name="leaf"/></BehaviorTree></root>"""
    tree = load_tree(text)
    again = load_tree(tree_to_xml(tree))
    assert [node.path for node in again.nodes] == [node.path for node in tree.nodes]
    assert list(again.blackboards) == list(tree.blackboards)
    assert "first/named" in again.blackboards


def test_subtrees_of_one_name_and_different_content_are_exported_apart() -> None:
    def variant(ticks: int) -> SubTree:
        def move() -> Move:
            return Move(to="1;2", ticks=ticks)

        return SubTree(move)

    tree = build_tree(Sequence([variant(1), variant(2), variant(1)]), registry=registry())
    text = tree_to_xml(tree)
    assert text.count("<BehaviorTree") == 3
    assert [n.attributes.get("ticks") for n in load_tree(text, registry()).nodes if n.type_id == "Move"] == [
        "1",
        "2",
        "1",
    ]


def test_a_native_behaviour_cannot_be_exported() -> None:
    tree = build_tree(Sequence([py_trees.behaviours.Success("native")]))
    with pytest.raises(XmlError, match="native py_trees behaviour 'native'"):
        tree_to_xml(tree)


def test_a_control_character_cannot_be_exported() -> None:
    with pytest.raises(XmlError, match=r"U\+0001"):
        tree_to_xml(build_tree(Sequence([Script("a\x01b", code="a := 1")])))


def test_children_may_be_given_one_by_one_or_as_a_list_or_by_name() -> None:
    for root in (
        Sequence("s", Script(code="a := 1"), Script(code="b := 1")),
        Sequence("s", [Script(code="a := 1"), Script(code="b := 1")]),
        Sequence(name="s", children=[Script(code="a := 1"), Script(code="b := 1")]),
    ):
        tree = build_tree(root)
        assert tree.tick_exactly_once() == SUCCESS
        assert tree.blackboard.keys() == ["a", "b"]
    assert build_tree(Inverter(child=Script(code="a := 1"))).tick_exactly_once() == FAILURE


def test_a_node_can_belong_to_one_tree_only() -> None:
    node = Script(code="a := 1")
    build_tree(node)
    with pytest.raises(TreeLoadError, match="part of a tree already"):
        build_tree(Sequence([node]))


def test_odd_arguments_are_a_type_error() -> None:
    with pytest.raises(TypeError, match="takes a name and children but got 3"):
        Sequence(3)
    with pytest.raises(TypeError, match="SubTree takes a node, a function"):
        SubTree(3)


def test_a_tree_that_contains_itself_is_refused() -> None:
    with pytest.raises(TreeLoadError, match="needs 1|at least 1"):
        build_tree(Sequence([]))


@pytest.mark.slow
def test_faults_of_a_python_tree_name_the_line_that_makes_the_node(tmp_path: Path) -> None:
    (tmp_path / "parts_beside.py").write_text(
        "from bestman_bt.engine import AlwaysSuccess, Sequence, Sleep\n\n\n"
        "class Mine(Sleep):\n"
        "    def __init__(self, name, **ports):\n        super().__init__(name, **ports)\n\n\n"
        "def wait():\n    return Sequence('waits', [Mine('own', msec='soon')])\n"
    )
    file = tmp_path / "tree.py"
    file.write_text(
        "from parts_beside import Mine, wait\nfrom bestman_bt.engine import RetryUntilSuccessful, Sequence\n\n\n"
        "def build():\n    twice = Mine('good', msec=1)\n"
        "    return Sequence('main', [\n        RetryUntilSuccessful(\n            wait(), num_attempts='x'),\n"
        "        Mine('lacking', mesc=5), twice, twice])\n"
    )
    with pytest.raises(TreeLoadError) as caught:
        load_tree(file)
    assert [str(problem).replace(f"{tmp_path}/", "") for problem in caught.value.problems] == [
        "parts_beside.py:10: <Mine> port 'msec': 'soon' is not an int",
        "tree.py:6: <Mine>: 'good' is part of a tree already; make a new node",
        "tree.py:8: <RetryUntilSuccessful> port 'num_attempts': 'x' is not an int",
        "tree.py:10: <Mine>: unknown port 'mesc' (did you mean 'msec'?)",
        "tree.py:10: <Mine> port 'msec': it is required but not given (of type int)",
    ]
    (tmp_path / "nothing.py").write_text("\n\ndef build():\n    pass\n")
    with pytest.raises(TreeLoadError, match=r"nothing\.py:3: its build\(\) returned None"):
        load_tree(tmp_path / "nothing.py")


def test_a_node_made_in_python_is_called_by_its_line(tmp_path: Path) -> None:
    (tmp_path / "tree.py").write_text(
        "from bestman_bt.engine import Sleep\n\n\ndef build():\n    return Sleep(msec=1)\n"
    )
    assert load_tree(tmp_path / "tree.py").root.where == "Sleep (tree.py:5)"


class Explains(StatefulAction):
    """Fails in its second tick, and says the number of the attempt; forgets that when it begins anew."""

    attempt = 0

    def on_start(self) -> int:
        self.attempt += 1
        self.feedback_message = ""
        return RUNNING

    def on_running(self) -> int:
        self.feedback_message = f"attempt {self.attempt}"
        return FAILURE


@pytest.mark.parametrize("kind", ["RetryUntilSuccessful", "RecoveryNode"])
def test_what_a_leaf_says_of_each_attempt_reaches_the_listeners(kind: str) -> None:
    leaf = Explains()
    root = (
        RetryUntilSuccessful(leaf, num_attempts=3)
        if kind == "RetryUntilSuccessful"
        else RecoveryNode([leaf, Script(code="a := 1")], number_of_retries=2)
    )
    tree = build_tree(root)
    told: list[str] = []
    tree.subscribe(lambda changes: told.extend(leaf.feedback_message for change in changes if change == (2, FAILURE)))
    while tree.tick_once() == RUNNING:
        pass
    assert told == ["attempt 1", "attempt 2", "attempt 3"]
