"""Trees of other BehaviorTree.CPP processes: placeholders, models, packages."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.engine import NodeError, SyncAction, TreeLoadError, load_tree, render_dot, render_svg, render_text
from bestman_bt.engine.core.registry import NodeRegistry
from bestman_bt.engine.models.foreign import Placeholders, missing_nodes, open_tree
from bestman_bt.engine.models.node_models import GUESS
from bestman_bt.engine.models.overview import overview_dot, overview_svg, overview_text
from bestman_bt.engine.models.package import Package
from bestman_bt.engine.status import SUCCESS
from bestman_bt.engine.validation import validate_file
from bestman_bt.engine.xml import checking
from bestman_bt.engine.xml.writer import full_tree_xml


def document(body: str, *, tree_id: str = "Main", more: str = "", main: str = "") -> str:
    attribute = f' main_tree_to_execute="{main}"' if main else ""
    return f'<root BTCPP_format="4"{attribute}><BehaviorTree ID="{tree_id}">\n{body}\n</BehaviorTree>{more}</root>'


MODEL = """<TreeNodesModel><Condition ID="DoorOpen"><input_port name="door" type="std::string" default="front">which
one</input_port><output_port name="angle" type="double"/></Condition></TreeNodesModel>"""


def test_what_is_not_known_is_guessed_from_its_use() -> None:
    tree = open_tree(
        document(
            '<Keep><Sequence><Move to="{goal}" speed="0.3"/><Move to="{goal}" speed="{fast}"/>'
            '<IsNear what="{goal}"/><Any><AlwaysSuccess/><AlwaysSuccess/></Any>'
            '<Control ID="One"><AlwaysSuccess/></Control>'
            "</Sequence></Keep>"
        )
    )
    missing = missing_nodes(tree)
    kinds = {name: info.kind for name, info in missing.items()}
    assert kinds == {
        "Keep": "Decorator", "Move": "Action", "IsNear": "Condition", "Any": "Control", "One": "Control",
    }  # fmt: skip
    assert {name: port.direction for name, port in missing["Move"].ports.items()} == {"to": "inout", "speed": "input"}
    assert {info.known_from for info in missing.values()} == {GUESS}


def test_a_model_in_the_file_comes_before_a_guess_and_before_other_models(tmp_path: Path) -> None:
    (tmp_path / "other.xml").write_text(f'<root BTCPP_format="4">{MODEL.replace("Condition", "Action")}</root>')
    (tmp_path / "own.xml").write_text(document("<DoorOpen/>", more=MODEL))
    (tmp_path / "none.xml").write_text(document("<DoorOpen/>"))
    package = Package.open([tmp_path / "other.xml"])
    own = missing_nodes(open_tree(tmp_path / "own.xml", package=package))["DoorOpen"]
    assert (own.kind, own.known_from) == ("Condition", f"{tmp_path / 'own.xml'}:3")
    port = own.ports["door"]
    assert (port.direction, port.default, port.description) == ("input", "front", "which\none")
    assert own.ports["angle"].type_name == "double"
    other = missing_nodes(open_tree(tmp_path / "none.xml", package=package))["DoorOpen"]
    assert (other.kind, other.known_from) == ("Action", f"{tmp_path / 'other.xml'}:1")


def test_models_that_disagree_about_a_kind_are_reported_with_both_places(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(f'<root BTCPP_format="4">{MODEL}</root>')
    (tmp_path / "b.xml").write_text(f'<root BTCPP_format="4">{MODEL.replace("Condition", "Action")}</root>')
    (problem,) = Package.open([tmp_path]).problems
    assert problem.file.endswith("b.xml")
    assert "its kind is Condition at" in problem.message
    assert "a.xml:1, and Action here" in problem.message


def test_placeholders_are_drawn_dashed_and_said_in_text() -> None:
    tree = open_tree(document("<Sequence><Move/><AlwaysSuccess/></Sequence>"))
    assert "── Move [placeholder]" in render_text(tree)
    assert render_svg(tree).count("stroke-dasharray") == 1
    assert render_dot(tree).count("dashed") == 1


def test_groot2_is_told_of_placeholders_with_kind_and_ports() -> None:
    xml = full_tree_xml(open_tree(document('<DoorOpen door="{d}"/>', more=MODEL)))
    assert '<Condition ID="DoorOpen">' in xml
    assert '<output_port name="angle" type="double"/>' in xml


def test_a_placeholder_refuses_its_tick() -> None:
    tree = open_tree(document("<Move/>"))
    with pytest.raises(NodeError, match="there is no code for 'Move' here"):
        tree.tick_once()


class Turn(SyncAction):
    """Has a port."""

    from py_trees.ports import PortInformation

    INPUT_PORTS = {"angle": PortInformation(float, True, "radians")}

    def on_tick(self) -> int:
        """Succeed."""
        return SUCCESS


def test_a_node_of_ours_with_other_ports_is_a_placeholder_with_both_sets_and_reported_as_missing() -> None:
    registry = NodeRegistry()
    registry.register(Turn)
    gaps = Placeholders()
    tree = open_tree(document('<Turn degrees="{d}" angle="far"/>'), registry, gaps=gaps)
    assert list(missing_nodes(tree)["Turn"].ports) == ["angle", "degrees"]
    assert [(problem.field, problem.missing) for problem in gaps.problems] == [("", True), ("angle", True)]
    assert not missing_nodes(open_tree(document('<Turn angle="1"/>'), registry))


@pytest.mark.parametrize(
    ("ports", "missing"),
    [("", False), ('<input_port name="angle"/>', False), ('<input_port name="degrees"/>', True)],
)
def test_a_wrong_port_of_a_node_of_ours_is_an_error_unless_a_model_declares_another_node(
    tmp_path: Path, ports: str, missing: bool
) -> None:
    registry = NodeRegistry()
    registry.register(Turn)
    model = f'<TreeNodesModel><Action ID="Turn">{ports}</Action></TreeNodesModel>' if ports else ""
    (tmp_path / "t.xml").write_text(document('<Turn degrees="90"/>', more=model))
    found = validate_file(tmp_path / "t.xml", registry)
    assert [(problem.field, problem.missing) for problem in found] == [("", missing), ("angle", missing)]


def test_what_every_behaviortree_cpp_refuses_is_still_an_error() -> None:
    with pytest.raises(TreeLoadError, match="unknown port 'ms'"):
        open_tree(document('<Sleep ms="3"/>'))
    with pytest.raises(TreeLoadError, match="exactly one child"):
        open_tree(document("<Inverter/>"))


def test_load_tree_reports_all_that_is_missing_a_cause_a_line() -> None:
    with pytest.raises(TreeLoadError) as error:
        load_tree(document("<Sequence>\n<Move/>\n<Move/>\n<Turn/>\n<Move/></Sequence>"))
    lines = str(error.value).splitlines()
    assert lines[0].startswith("<text>:3: <Move>: unknown node 'Move'")
    assert lines[0].endswith("[3 times: also in lines 4, 6]")
    assert len(lines) == 2


def test_of_several_trees_without_a_main_one_the_first_that_nobody_uses_is_opened() -> None:
    used = '<BehaviorTree ID="Used"><AlwaysSuccess/></BehaviorTree>'
    top = '<BehaviorTree ID="Top"><SubTree ID="Used"/></BehaviorTree>'
    assert open_tree(f'<root BTCPP_format="4">{used}{top}</root>').tree_id == "Top"


def test_a_tree_that_is_not_there_is_a_placeholder_below_its_subtree() -> None:
    gaps = Placeholders()
    tree = open_tree(document('<SubTree ID="Elsewhere"/>'), gaps=gaps)
    assert "Elsewhere '(not found)' [placeholder]" in render_text(tree).replace("Elsewhere (not found)", "(not found)")
    assert [problem.missing for problem in gaps.problems] == [True]


@pytest.fixture
def package(tmp_path: Path) -> Path:
    (tmp_path / "main.xml").write_text(document('<SubTree ID="Pick" name="p"/>', main="Main"))
    inner = document('<SubTree ID="Helper" name="h"/>', tree_id="Pick")
    helper = '<BehaviorTree ID="Helper"><AlwaysSuccess name="of pick"/></BehaviorTree>'
    (tmp_path / "pick.xml").write_text(inner.replace("</root>", f"{helper}</root>"))
    (tmp_path / "place.xml").write_text(document('<AlwaysSuccess name="of place"/>', tree_id="Helper"))
    (tmp_path / "robot.xml").write_text("<robot/>")
    return tmp_path


def test_a_subtree_is_found_in_another_file_of_the_package_whose_own_trees_come_first(package: Path) -> None:
    tree = open_tree(package / "main.xml", package=Package.open([package]))
    assert [node.path for node in tree.nodes][-1] == "p/h/of pick"
    assert tree.tick_once() == SUCCESS
    assert not validate_file(package / "main.xml", package=Package.open([package]))


def test_a_tree_of_the_same_name_elsewhere_is_no_circle(package: Path) -> None:
    (package / "main.xml").write_text(document('<SubTree ID="Pick" name="p"/>', tree_id="Helper"))
    tree = open_tree(package / "main.xml", package=Package.open([package]))
    assert [node.path for node in tree.nodes][-1] == "p/h/of pick"


def test_an_id_that_two_other_files_define_is_an_error_with_both_places(package: Path) -> None:
    (package / "main.xml").write_text(document('<SubTree ID="Helper"/>'))
    (problem,) = validate_file(package / "main.xml", package=Package.open([package]))
    assert "pick.xml:3 and" in problem.message
    assert "place.xml:1" in problem.message
    assert not problem.missing


def test_a_circle_through_two_files_is_an_error(package: Path) -> None:
    (package / "pick.xml").write_text(document('<SubTree ID="Main"/>', tree_id="Pick"))
    problems = validate_file(package / "main.xml", package=Package.open([package]))
    assert any("include each other recursively: Main -> Pick -> Main" in problem.message for problem in problems)


def test_a_circle_that_the_main_tree_does_not_use_is_an_error_too(package: Path) -> None:
    unused = (
        '<BehaviorTree ID="A"><SubTree ID="B"/></BehaviorTree><BehaviorTree ID="B"><SubTree ID="Pick"/></BehaviorTree>'
    )
    (package / "main.xml").write_text(document("<AlwaysSuccess/>", main="Main").replace("</root>", f"{unused}</root>"))
    assert not [
        one for one in validate_file(package / "main.xml", package=Package.open([package])) if one.severity != "warning"
    ]
    (package / "pick.xml").write_text(document('<SubTree ID="B"/>', tree_id="Pick"))
    problems = validate_file(package / "main.xml", package=Package.open([package]))
    (circle,) = (one for one in problems if one.severity != "warning")
    assert "include each other recursively: B -> Pick -> B" in circle.message


def test_the_overview_tells_who_uses_whom(package: Path) -> None:
    found = Package.open([package])
    assert found.others == 1
    text = overview_text(found)
    assert "Main (line 1): 1 nodes; uses Pick; used by no other tree" in text
    assert '"Pick" -> "Helper";' in overview_dot(found)
    assert overview_svg(found).count("<rect") == 4
    assert [one.tree_id for one in found.unused()] == []


def test_a_tree_that_another_file_uses_is_not_unused(package: Path) -> None:
    file = package / "pick.xml"
    more = (
        '<BehaviorTree ID="Start"><AlwaysSuccess/></BehaviorTree><BehaviorTree ID="Old"><AlwaysFailure/></BehaviorTree>'
    )
    text = (
        file.read_text().replace("<root ", '<root main_tree_to_execute="Start" ').replace("</root>", f"{more}</root>")
    )
    file.write_text(text)
    told = [problem.message for problem in validate_file(file, package=Package.open([package]))]
    assert told == ["tree 'Old' is never used"]
    assert "tree 'Pick' is never used" in [problem.message for problem in validate_file(file)]


def test_a_project_of_groot2_names_files_and_models(package: Path) -> None:
    project = package / "robot.btproj"
    project.write_text(f'<root BTCPP_format="4"><include path="pick.xml"/><include path="gone.xml"/>{MODEL}</root>')
    found = Package.open([project])
    assert list(found.models) == ["DoorOpen"]
    assert [one.tree_id for one in found.trees()] == ["Pick", "Helper"]
    assert "there is no file 'gone.xml'" in str(found.problems[0])


def test_a_package_of_too_many_files_is_refused(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bestman_bt.engine.models.package.MAX_FILES", 3)
    with pytest.raises(TreeLoadError, match="more than 3 XML files"):
        Package.open([package])


def test_names_of_unknown_nodes_are_compared_with_known_ones_only_where_a_hint_is_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compared: list[str] = []
    monkeypatch.setattr(checking, "closest", lambda name, known: compared.append(name) or "Sleep")
    (tmp_path / "tree.xml").write_text(document("<Slep/>"))
    assert set(missing_nodes(open_tree(tmp_path / "tree.xml"))) == {"Slep"}
    assert compared == []
    (problem,) = validate_file(tmp_path / "tree.xml")
    assert (problem.suggestion, compared) == ("did you mean 'Sleep'?", ["Slep"])
