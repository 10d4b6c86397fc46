"""Skeletons of leaves: they load at once, fail as not implemented, and what is there is never changed."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.engine import FAILURE, NodeRegistry, TreeLoadError, load_tree
from bestman_bt.engine.models.node_models import unknown_types
from bestman_bt.engine.models.package import Package
from bestman_bt.engine.models.stubs import stub_source
from bestman_bt.runtime.plugins import node_registry

TREE = """<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>
<Action ID="Move to Waypoint" name="{w}" waypoint="{w}" class="1" status="2"/><OpenLid lid="3" angle="{a}"/>
<Condition ID="LidOpen"/><Each><SubTree ID="Other"/></Each></Sequence></BehaviorTree>
<BehaviorTree ID="Other"><Sleep msec="1"/></BehaviorTree>
<TreeNodesModel><Action ID="OpenLid"><input_port name="lid" type="int" default="2">which "lid"</input_port>
<output_port name="angle" type="double"/><input_port name="speed" type="double" default="0.5"/>
<input_port name="grip" type="geometry::Grip" default="tight"/><input_port name="from" default="{here}"/>
<description>Opens a lid \\ slowly</description></Action></TreeNodesModel></root>""".replace(' name="{w}"', "")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "t.xml").write_text(TREE.replace("<root ", '<root main_tree_to_execute="Main" '))
    return tmp_path


def stub(folder: Path) -> list[str]:
    package = Package.open([folder])
    infos = unknown_types(package.files.values(), NodeRegistry(), package.models).values()
    file = folder / "leaves.py"
    content, added = stub_source(infos, file.read_bytes() if file.exists() else b"", str(file))
    file.write_bytes(content)
    return sorted(added)


def test_a_stub_loads_at_once_and_fails_as_not_implemented(folder: Path) -> None:
    assert stub(folder) == ["LidOpen", "Move to Waypoint", "OpenLid"]
    registry = node_registry([str(folder / "leaves.py")])
    ports = registry.info("OpenLid").ports
    assert {name: (port.direction, port.type_name, port.default) for name, port in ports.items()} == {
        "lid": ("input", "int", 2),
        "angle": ("output", "float", None),
        "speed": ("input", "float", 0.5),
        "grip": ("input", "any", None),
        "from": ("input", "any", "{here}"),
    }
    assert ports["lid"].description == 'which "lid"'
    assert registry.info("OpenLid").description == "Opens a lid / slowly."
    (folder / "t.xml").write_text(TREE.replace("<Each>", "").replace("</Each>", "").replace("<root", "<root "))
    tree = load_tree(folder / "t.xml", registry, main_tree="Main")
    assert tree.tick_once() == FAILURE
    assert tree.nodes[1].feedback_message == "not_implemented"


def test_defaults_that_are_no_finite_numbers_and_names_of_imports_load(folder: Path) -> None:
    names = ("In", "Out", "Any", "StatefulAction", "float", "FAILURE")
    leaves = "".join(f'<{name} x="{{e}}"/>' for name in names)
    ports = "".join(
        f'<input_port name="p{number}" type="double" default="{text}"/>'
        for number, text in enumerate(("nan", "inf", "-inf", "1e400"))
    )
    models = (
        f'<Action ID="In">{ports}<input_port name="all" type="std::vector&lt;double&gt;" default="1;inf"/></Action>'
    )
    (folder / "t.xml").write_text(
        f'<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence>{leaves}</Sequence></BehaviorTree>'
        f"<TreeNodesModel>{models}</TreeNodesModel></root>"
    )
    assert stub(folder) == sorted(names)
    registry = node_registry([str(folder / "leaves.py")])
    found = registry.info("In").ports
    assert [port.default for port in found.values() if port.name != "x"] == [None] * 5
    assert all(name in registry for name in names)
    assert stub(folder) == []


def test_a_second_run_adds_what_is_new_and_changes_nothing_else(folder: Path) -> None:
    stub(folder)
    file = folder / "leaves.py"
    mine = file.read_text().replace("Stands for the condition LidOpen.", "Mine.") + "\nX = 1\n"
    file.write_text(mine)
    assert stub(folder) == []
    assert file.read_text() == mine
    (folder / "t.xml").write_text(TREE.replace("<OpenLid ", "<Wipe/><OpenLid "))
    assert stub(folder) == ["Wipe"]
    assert file.read_text().startswith(mine)
    assert "Wipe" in node_registry([str(file)])


@pytest.mark.parametrize("content", [b"x = 1\ndef f(:\n", b"x = 1\nname = '\xe9'\n"])
def test_a_file_that_is_no_python_is_refused_with_its_line(folder: Path, content: bytes) -> None:
    (folder / "leaves.py").write_bytes(content)
    with pytest.raises(TreeLoadError, match=r"leaves\.py:2: it is not Python"):
        stub(folder)


def test_leaves_that_were_rewritten_by_hand_are_recognised(folder: Path) -> None:
    (folder / "leaves.py").write_bytes(
        b"\xef\xbb\xbffrom typing import ClassVar\r\n\r\nfrom bestman_bt.engine import Condition, SyncAction\r\n\r\n"
        b"if True:\r\n    class LidOpen(Condition):\r\n        pass\r\n\r\n"
        b"class Go(SyncAction):\r\n    NAME: ClassVar[str] = 'Move to Waypoint'\r\n\r\n"
        b"class Opener(SyncAction):\r\n    pass\r\n\r\n"
        b"def register(registry):\r\n    registry.register(Opener, 'OpenLid')\r\n"
    )
    assert stub(folder) == []
    (folder / "t.xml").write_text(TREE.replace("<OpenLid ", "<Wipe/><OpenLid "))
    before = (folder / "leaves.py").read_bytes()
    assert stub(folder) == ["Wipe"]
    after = (folder / "leaves.py").read_bytes()
    assert after.startswith(before.rstrip()), "byte order mark and line ends stay"
    assert after.count(b"\n") == after.count(b"\r\n")
    registry = node_registry([str(folder / "leaves.py")])
    assert all(name in registry for name in ("Wipe", "LidOpen", "Move to Waypoint", "OpenLid"))


@pytest.mark.parametrize(
    ("lines", "there"),
    [
        ("class Opener:\n    pass\nregistry.register(Opener, name='OpenLid')", True),
        ("class Opener:\n    pass\nregistry.register(name='OpenLid', cls=Opener)", True),
        ("from leaves_of_lids import Opener\nregistry.register(Opener, 'OpenLid')", True),
        ("import leaves_of_lids\nregistry.register(leaves_of_lids.Opener, 'OpenLid')", True),
        ("import atexit\nimport os\natexit.register(os.remove, 'OpenLid')", False),
        ("import atexit\natexit.register(print, 'OpenLid')", False),
        ("import atexit\ndef close():\n    pass\natexit.register(close, 'OpenLid')", False),
        ("def opener():\n    pass\nhandlers.register('OpenLid', opener)\nhandlers.register(*'OpenLid')", False),
        ("class Opener:\n    pass\nregistry.register(Opener)\nregistry.register()", False),
    ],
)
def test_a_registered_class_is_recognised_and_nothing_else_that_is_registered(
    folder: Path, lines: str, there: bool
) -> None:
    (folder / "leaves.py").write_text(lines)
    assert ("OpenLid" not in stub(folder)) is there


def test_new_classes_have_the_encoding_of_their_file(folder: Path) -> None:
    xml = (folder / "t.xml").read_text()
    (folder / "t.xml").write_text(xml.replace("slowly", "größtenteils"), encoding="utf-8")
    file = folder / "leaves.py"
    before = "# -*- coding: latin-1 -*-\nTÜR = 1\n".encode("latin-1")
    file.write_bytes(before)
    stub(folder)
    assert file.read_bytes().startswith(before.rstrip())
    assert node_registry([str(file)]).info("OpenLid").description == "Opens a lid / größtenteils."
    file.write_bytes(before)
    (folder / "t.xml").write_text(xml.replace("slowly", "→"), encoding="utf-8")
    with pytest.raises(TreeLoadError, match=r"leaves\.py: its encoding iso-8859-1 has no '→'"):
        stub(folder)
    assert file.read_bytes() == before
