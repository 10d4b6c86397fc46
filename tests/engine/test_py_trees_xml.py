"""XML of py_trees: read as nodes here, which do what py_trees' own parser makes of the file."""

from __future__ import annotations

from pathlib import Path

import py_trees
import pytest
from py_trees.common import Status
from py_trees.demos.ports import nested_subtrees
from py_trees.parsers.behaviour_tree_xml import parse_behaviour_tree_xml
from py_trees.ports import PortInformation, PortsMixin

from bestman_bt.engine import FAILURE, RUNNING, SUCCESS, Condition, NodeRegistry, load_tree, render_text
from bestman_bt.engine.models.foreign import open_tree
from bestman_bt.engine.status import TO_PY_TREES
from bestman_bt.engine.validation import validate_file

RESULTS = {"S": (SUCCESS, Status.SUCCESS), "F": (FAILURE, Status.FAILURE), "R": (RUNNING, Status.RUNNING)}


class Played(Condition):
    """Returns the results that its port lists, one a tick, in turn."""

    INPUT_PORTS = {"results": PortInformation(str)}

    def on_load(self) -> None:
        self.ticks = 0

    def on_tick(self) -> int:
        results = self.get_input("results")
        self.ticks += 1
        return RESULTS[results[(self.ticks - 1) % len(results)]][0]


class NativePlayed(PortsMixin, py_trees.behaviour.Behaviour, tag="Played"):
    """The same for py_trees."""

    INPUT_PORTS = {"results": PortInformation(str)}
    OUTPUT_PORTS: dict[str, PortInformation] = {}
    ticks = 0

    def update(self) -> Status:
        results = self.get_input("results")
        self.ticks += 1
        return RESULTS[results[(self.ticks - 1) % len(results)]][1]


def leaves(*results: str) -> str:
    return "".join(f'<Played name="l{number}" results="{one}"/>' for number, one in enumerate(results))


def written(path: Path, body: str, more: str = "") -> Path:
    path.write_text(
        f'<root main_tree_to_execute="M">\n<BehaviorTree ID="M">{body}</BehaviorTree>{more}</root>', encoding="utf-8"
    )
    return path


@pytest.fixture
def registry() -> NodeRegistry:
    registry = NodeRegistry()
    registry.register(Played)
    return registry


@pytest.mark.parametrize(
    "body",
    [
        f'<Sequence name="a" memory="true">{leaves("S", "RRS", "SF")}</Sequence>',
        f'<sequence name="a" memory="false">{leaves("SF", "RRS", "S")}</sequence>',
        f'<Selector name="a">{leaves("F", "RRF", "SF")}</Selector>',
        f'<selector name="a" memory="false">{leaves("FS", "RRF", "S")}</selector>',
        f'<Parallel name="a" policy="success_on_all">{leaves("S", "RRS", "RS")}</Parallel>',
        f'<Parallel name="a" policy="success_on_one">{leaves("R", "RS")}</Parallel>',
        f'<FailureIsSuccess name="a">{leaves("RF")}</FailureIsSuccess>',
        f'<SuccessIsFailure name="a">{leaves("RS")}</SuccessIsFailure>',
        f'<SuccessIsRunning name="a">{leaves("SSF")}</SuccessIsRunning>',
        f'<Inverter name="a"><Selector name="b">{leaves("RF")}</Selector></Inverter>',
    ],
)
def test_the_tree_ticks_as_the_one_that_py_trees_makes_of_the_file(
    tmp_path: Path, registry: NodeRegistry, body: str
) -> None:
    path = written(tmp_path / "t.xml", body)
    py_trees.blackboard.Blackboard.clear()
    native, tree = parse_behaviour_tree_xml(str(path)), load_tree(path, registry)
    for _ in range(8):
        native.tick_once()
        assert TO_PY_TREES[tree.tick_exactly_once()] == native.status


def test_ports_and_files_are_translated(tmp_path: Path) -> None:
    (tmp_path / "b.xml").write_text(
        '<root><BehaviorTree ID="S" speed="1.5"><Go name="go" at="{speed}"/></BehaviorTree></root>'
    )
    once = '<OneShot name="o" policy="on_completion"><Go name="g"/></OneShot>'
    again = f'<Retry name="r" num_failures="3"><Repeat name="n" num_success="2">{once}</Repeat></Retry>'
    path = tmp_path / "a.xml"
    path.write_text(
        '<root main_tree_to_execute="M">\n<Import src="b.xml"/>\n<BehaviorTree ID="M"><Selector name="s">'
        f'<Timeout name="t" duration="2.5">{again}</Timeout><SubTree ID="S" name="x"/></Selector></BehaviorTree></root>'
    )
    tree = open_tree(path)
    assert render_text(tree).splitlines() == [
        "Fallback 's'",
        "├── Timeout 't'  msec=2500",
        "│   └── RetryUntilSuccessful 'r'  num_attempts=3",
        "│       └── Repeat 'n'  num_cycles=2",
        "│           └── OneShot 'o' [placeholder]  policy=on_completion",
        "│               └── Go 'g' [placeholder]",
        "└── SubTree S 'x'",
        "    └── Go 'go' [placeholder]  at={speed}",
    ]
    assert tree.blackboards["x"].get("speed") == 1.5
    (warning,) = (problem for problem in validate_file(path) if problem.severity == "warning")
    assert str(warning).startswith(f"{path}:2: warning: <Import>: the file is in the format of py_trees")


@pytest.mark.parametrize("said", ['BTCPP_format="4" ', ""])
def test_files_of_behaviortree_cpp_stay_as_they_are(tmp_path: Path, registry: NodeRegistry, said: str) -> None:
    path = written(tmp_path / "t.xml", f'<Sequence name="a">{leaves("S")}</Sequence>')
    path.write_text(path.read_text().replace("<root ", f"<root {said}"))
    assert load_tree(path, registry).root.attributes == {"name": "a"}
    assert validate_file(path, registry) == []


def test_a_selector_of_a_file_of_version_4_is_nobodys_but_the_users(tmp_path: Path) -> None:
    path = written(tmp_path / "t.xml", '<Selector name="a"><AlwaysSuccess/></Selector>')
    path.write_text(path.read_text().replace("<root ", '<root BTCPP_format="4" '))
    assert open_tree(path).root.type_id == "Selector"


def test_py_trees_own_example_opens_and_runs_through_its_parser(tmp_path: Path) -> None:
    example = Path(nested_subtrees.__file__).with_suffix(".xml")
    assert "SubTree ArmPickupRoutine" in render_text(open_tree(example))
    file = tmp_path / "tree.py"
    file.write_text(
        "from py_trees.demos.ports import nested_subtrees\n"
        "from py_trees.parsers.behaviour_tree_xml import parse_behaviour_tree_xml\n\n\n"
        f"def build():\n    return parse_behaviour_tree_xml({str(example)!r})\n"
    )
    tree = load_tree(file)
    assert tree.tick_while_running() == SUCCESS
    assert [node.type_id for node in tree.nodes].count("AddMissionStep") == 5
