"""What is wrong with a tree file is reported all at once, with file, line, node and the closest valid name."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from bestman_bt.engine import SUCCESS, NodeRegistry, PortInformation, SyncAction, TreeLoadError, build_tree, load_tree
from bestman_bt.engine.errors import TreeProblem


class NavigateTo(SyncAction):
    """Drive."""

    INPUT_PORTS = {
        "goal": PortInformation(list[float]),
        "speed": PortInformation(float, False, "m/s", 0.5),
    }
    OUTPUT_PORTS = {"pose": PortInformation(list[float], False)}

    def on_tick(self) -> int:
        return SUCCESS


@pytest.fixture
def registry() -> NodeRegistry:
    registry = NodeRegistry()
    registry.register(NavigateTo)
    return registry


def problems(text: str, registry: NodeRegistry) -> list[str]:
    with pytest.raises(TreeLoadError) as caught:
        load_tree(text, registry)
    return [str(problem) for problem in caught.value.problems]


def document(body: str, attributes: str = "", more: str = "") -> str:
    return f'<root BTCPP_format="4"{attributes}>\n<BehaviorTree ID="Main">\n{body}\n</BehaviorTree>\n{more}</root>'


def test_with_faults_the_rest_of_a_tree_is_there_to_be_checked(registry: NodeRegistry) -> None:
    text = document(
        '<Sequense>\n<NavigateTo goal="1;2" speed="fast"/>\n<Drive/>\n<SubTree ID="Mian"/>\n<Sleep msec="20"/>\n'
        '<Inverter><AlwaysSuccess/><Drive/></Inverter>\n<Script code="a :="/>\n</Sequense>'
    )
    faults: list[TreeProblem] = []
    tree = load_tree(text, registry, faults=faults)
    assert [str(fault) for fault in faults] == problems(text, registry)
    kinds = ["Sequence", "NavigateTo", "AlwaysSuccess", "AlwaysSuccess", "Sleep", "Sequence"]
    kinds += ["AlwaysSuccess", "AlwaysSuccess", "Script"]
    assert [node.type_id for node in tree.nodes] == kinds
    assert tree.nodes[1].attributes == {"goal": "1;2"}
    several: list[TreeProblem] = []
    assert len(load_tree(document("<NavigateTo/>\n<Drive/>"), registry, faults=several).nodes) == 3
    assert [fault.line for fault in several] == [2, 3, 4]
    with pytest.raises(TreeLoadError):
        load_tree('<root BTCPP_format="4"/>', registry, faults=[])


def test_all_errors_of_a_file_come_at_once_in_order_of_their_lines(registry: NodeRegistry) -> None:
    text = document(
        '<Sequense>\n<NavigateTo gaol="1;2"/>\n<NavigateTo goal="near" speed="fast"/>\n'
        '<SubTree ID="Mian"/>\n</Sequense>'
    )
    assert problems(text, registry) == [
        "<text>:3: <Sequense>: unknown node 'Sequense' (did you mean 'Sequence'?)",
        "<text>:4: <NavigateTo>: unknown port 'gaol' (did you mean 'goal'?)",
        "<text>:4: <NavigateTo> port 'goal': it is required but not given (of type list[float])",
        "<text>:5: <NavigateTo> port 'goal': 'near' is not a number",
        "<text>:5: <NavigateTo> port 'speed': 'fast' is not a number",
        "<text>:6: <SubTree> 'ID': there is no tree 'Mian' (did you mean 'Main'?)",
    ]


def test_the_error_of_a_file_names_the_file(registry: NodeRegistry, tmp_path: Path) -> None:
    path = tmp_path / "fetch.xml"
    path.write_text(document("<Nope/>"))
    with pytest.raises(TreeLoadError, match=rf"{path}:3: <Nope>: unknown node 'Nope'"):
        load_tree(path, registry)


def test_a_missing_file_is_reported_to_be_missing(tmp_path: Path) -> None:
    with pytest.raises(TreeLoadError, match="the tree file does not exist"):
        load_tree(tmp_path / "none.xml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<root", "not well-formed XML"),
        ("<tree/>", "the outermost element must be <root>"),
        (
            '<root BTCPP_format="3"><BehaviorTree ID="M"><AlwaysSuccess/></BehaviorTree></root>',
            "is in the format of BehaviorTree.CPP 3",
        ),
        ('<root BTCPP_format="4"/>', "the file holds no <BehaviorTree>"),
        (document("<AlwaysSuccess/><AlwaysFailure/>"), "must have exactly one root node but has 2"),
        (document(""), "must have exactly one root node but has 0"),
        (document("<AlwaysSuccess/>", ' main_tree_to_execute="Other"'), "there is no tree 'Other'"),
        (
            document("<AlwaysSuccess/>", "", '<BehaviorTree ID="B"><AlwaysSuccess/></BehaviorTree>'),
            "the attribute is missing, and the file holds 2 trees: Main, B",
        ),
        (document("<Inverter/>"), "must have exactly one child but has 0"),
        (document("<AlwaysSuccess><AlwaysSuccess/></AlwaysSuccess>"), "must not have children but has 1"),
        (document("<TryCatch><AlwaysSuccess/></TryCatch>"), "must have at least 2 children but has 1"),
        (document("<Action/>"), "the attribute is missing; it names the node"),
        (document('<Script code="a := := 3"/>'), "expected operand at position 5 (got ':=')"),
        (document('<AlwaysSuccess _skipIf="a =="/>'), "expected operand at position 4 (got the end)"),
        (document('<NavigateTo goal="{g}" pose="here"/>'), "an output port is mapped to an entry, as '{pose}'"),
        (
            document('<SubTree ID="A"/>', ' main_tree_to_execute="Main"')[:-7]
            + '<BehaviorTree ID="A"><SubTree ID="Main"/></BehaviorTree></root>',
            "the trees include each other recursively: Main -> A -> Main",
        ),
        (
            document(
                '<Sequence><SubTree ID="A" name="x"/><SubTree ID="A" name="x"/></Sequence>',
                ' main_tree_to_execute="Main"',
                '<BehaviorTree ID="A"><AlwaysSuccess/></BehaviorTree>',
            ),
            "there are two SubTrees with the path 'x'",
        ),
        (
            document('<Sequence><NavigateTo goal="{g}"/><Repeat num_cycles="{g}"><AlwaysSuccess/></Repeat></Sequence>'),
            "entry 'g' is used as int but was declared as list[float]",
        ),
        (
            document(
                "<ReactiveSequence><AsyncSequence><AlwaysSuccess/></AsyncSequence>"
                "<AsyncSequence><AlwaysSuccess/></AsyncSequence></ReactiveSequence>"
            ),
            "it cannot have more than one AsyncSequence",
        ),
        ('<root BTCPP_format="4"><BehaviorTree ID="Sequence"><AlwaysSuccess/></BehaviorTree></root>', "name of a node"),
        ('<root BTCPP_format="4"><BehaviorTree ID="a/b"><AlwaysSuccess/></BehaviorTree></root>', "it contains '/'"),
    ],
)
def test_bad_input_gives_one_clear_message(text: str, message: str, registry: NodeRegistry) -> None:
    found = problems(text, registry)
    assert len(found) == 1
    assert message in found[0]


def test_a_value_type_without_text_form_cannot_be_a_literal() -> None:
    class Opaque:
        pass

    class Take(SyncAction):
        INPUT_PORTS = {"thing": PortInformation(Opaque)}

        def on_tick(self) -> int:
            return SUCCESS

    registry = NodeRegistry()
    registry.register(Take)
    assert (
        "a Opaque cannot be written as a literal; map an entry, as '{thing}'"
        in problems(document('<Take thing="x"/>'), registry)[0]
    )


def test_errors_inside_python_trees_name_the_node(tmp_path: Path, registry: NodeRegistry) -> None:
    path = tmp_path / "tree.py"
    path.write_text(
        "from bestman_bt.engine import Repeat, AlwaysSuccess, Sequence\n"
        "def build():\n    return Sequence([Repeat('again', AlwaysSuccess(), num_cycle=3)])\n"
    )
    with pytest.raises(TreeLoadError) as caught:
        load_tree(path, registry)
    assert [str(p) for p in caught.value.problems] == [
        f"{path}:3: <Repeat>: unknown port 'num_cycle' (did you mean 'num_cycles'?)",
        f"{path}:3: <Repeat> port 'num_cycles': it is required but not given (of type int)",
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("x = 1\n", "defines no function build"),
        ("raise OSError('broken')\n", "fails with OSError: broken"),
        ("def build():\n    return 3\n", "returned 3; a node is expected"),
        ("def build(:\n", "fails with SyntaxError"),
    ],
)
def test_a_python_tree_that_does_not_build_reports_why(source: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "tree.py"
    path.write_text(source)
    with pytest.raises(TreeLoadError, match=message):
        load_tree(path)


@pytest.mark.parametrize(
    ("source", "told"),
    [
        ("import sys\nsys.exit(3)\n", "2: it fails with SystemExit: 3"),
        (
            "def build():\n    return inner()\n\ndef inner():\n    raise SystemExit('enough')\n",
            "5: it fails with SystemExit",
        ),
        ("x = 1\nraise OSError('broken')\n", "2: it fails with OSError: broken"),
        ("import json\ndef build():\n    json.loads('{')\n", "3: it fails with JSONDecodeError"),
        ("x = 1\ndef build(:\n", "2: it fails with SyntaxError"),
    ],
)
def test_a_python_tree_that_raises_or_exits_is_reported_with_file_and_line(
    source: str, told: str, tmp_path: Path
) -> None:
    path = tmp_path / "tree.py"
    path.write_text(source)
    with pytest.raises(TreeLoadError) as caught:
        load_tree(path)
    assert str(caught.value).startswith(f"{path}:{told}")


@pytest.mark.parametrize(
    ("attributes", "port", "literal"),
    [
        ('goal="1;2" speed="nan"', "speed", "nan"),
        ('goal="1;NaN"', "goal", "1;NaN"),
        ('goal="json:[NaN]"', "goal", "json:[NaN]"),
    ],
)
def test_not_a_number_is_no_literal_of_a_numeric_port(
    attributes: str, port: str, literal: str, registry: NodeRegistry
) -> None:
    told = problems(document(f"<NavigateTo {attributes}/>"), registry)
    assert told == [f"<text>:3: <NavigateTo> port '{port}': '{literal}' is not a number"]


def test_infinity_is_a_literal_of_a_numeric_port(registry: NodeRegistry) -> None:
    assert load_tree(document('<NavigateTo goal="1;2" speed="inf"/>'), registry).nodes


def test_not_a_number_is_refused_of_nodes_made_in_python_too(registry: NodeRegistry) -> None:
    with pytest.raises(TreeLoadError, match="port 'speed': nan is not a number"):
        build_tree(NavigateTo(goal=[1.0, 2.0], speed=math.nan), registry=registry)
