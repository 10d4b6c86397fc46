"""Tree files in full: forms, includes, models, the palette, lossless rewriting, paths."""

from __future__ import annotations

import re
from contextlib import nullcontext
from pathlib import Path

import pytest

from bestman_bt.engine import (
    SUCCESS,
    NodeRegistry,
    PortInformation,
    SyncAction,
    TreeLoadError,
    XmlDocument,
    load_tree,
    palette_xml,
)
from bestman_bt.engine.catalogue import EXTENSIONS
from bestman_bt.engine.models.conversion import Converted, convert
from bestman_bt.engine.validation import validate_file
from bestman_bt.engine.xml.elements import parse_xml

ROOT = '<root BTCPP_format="4"{}>{}</root>'
TREE = '<BehaviorTree ID="{}">{}</BehaviorTree>'


class Say(SyncAction):
    """Say something."""

    INPUT_PORTS = {
        "words": PortInformation(list[str], True, "what to say"),
        "loud": PortInformation(bool, False, "", True),
    }
    OUTPUT_PORTS = {"said": PortInformation(float, False)}

    def on_tick(self) -> int:
        return SUCCESS


@pytest.fixture
def registry() -> NodeRegistry:
    registry = NodeRegistry()
    registry.register(Say)
    return registry


def write(folder: Path, name: str, body: str, attributes: str = "") -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(ROOT.format(attributes, body))
    return path


def test_the_explicit_form_is_the_compact_form(registry: NodeRegistry) -> None:
    compact = load_tree(ROOT.format("", TREE.format("M", '<Inverter><Say words="a;b"/></Inverter>')), registry)
    explicit = load_tree(
        ROOT.format("", TREE.format("M", '<Decorator ID="Inverter"><Action ID="Say" words="a;b"/></Decorator>')),
        registry,
    )
    assert [n.path for n in explicit.nodes] == [n.path for n in compact.nodes] == ["Inverter::1", "Say::2"]
    assert explicit.nodes[1].get_input("words") == ["a", "b"]


def test_every_node_knows_its_line(registry: NodeRegistry) -> None:
    text = ROOT.format("", TREE.format("M", '\n<Sequence>\n\n<Say words="a"/>\n<Say words="b"/></Sequence>'))
    assert [node.line for node in load_tree(text, registry).nodes] == [2, 4, 5]


def test_the_main_tree_can_be_chosen_by_the_caller() -> None:
    text = ROOT.format("", TREE.format("A", "<AlwaysSuccess/>") + TREE.format("B", "<AlwaysFailure/>"))
    assert load_tree(text, main_tree="B").root.type_id == "AlwaysFailure"


def test_included_files_are_found_beside_the_file_and_beneath(tmp_path: Path) -> None:
    write(tmp_path, "parts/leaf.xml", TREE.format("Leaf", "<AlwaysSuccess/>"))
    write(tmp_path, "parts/middle.xml", '<include path="leaf.xml"/>' + TREE.format("Middle", '<SubTree ID="Leaf"/>'))
    main = write(
        tmp_path,
        "main.xml",
        '<include path="parts/middle.xml"/><include path="parts/leaf.xml"/>'
        + TREE.format("Main", '<SubTree ID="Middle"/>'),
        ' main_tree_to_execute="Main"',
    )
    tree = load_tree(main)
    assert tree.tick_exactly_once() == SUCCESS
    assert [node.path for node in tree.nodes] == [
        "Middle::1",
        "Middle::1/Leaf::2",
        "Middle::1/Leaf::2/AlwaysSuccess::3",
    ]


def test_included_files_may_come_from_the_search_path(tmp_path: Path) -> None:
    write(tmp_path / "library", "leaf.xml", TREE.format("Leaf", "<AlwaysSuccess/>"))
    main = write(
        tmp_path / "project",
        "main.xml",
        '<include path="leaf.xml"/>' + TREE.format("Main", '<SubTree ID="Leaf"/>'),
        ' main_tree_to_execute="Main"',
    )
    assert load_tree(main, search_path=[tmp_path / "library"]).tick_exactly_once() == SUCCESS


@pytest.mark.parametrize("target", ["../secret.xml", "/etc/hostname", "none.xml", "nul\u0000.xml"])
def test_an_include_that_leads_out_of_the_folder_is_refused(target: str, tmp_path: Path) -> None:
    write(tmp_path, "secret.xml", TREE.format("Secret", "<AlwaysSuccess/>"))
    body = f'<include path="{target}"/>' + TREE.format("Main", "<AlwaysSuccess/>")
    main = write(tmp_path / "trees", "main.xml", body, ' main_tree_to_execute="Main"')
    with pytest.raises(TreeLoadError, match="is not a file in the tree's folder|NUL bytes"):
        load_tree(main)


def test_a_link_that_leads_out_of_the_folder_is_refused(tmp_path: Path) -> None:
    secret = write(tmp_path, "secret.xml", TREE.format("Secret", "<AlwaysSuccess/>"))
    body = '<include path="link.xml"/>' + TREE.format("Main", "<AlwaysSuccess/>")
    main = write(tmp_path / "trees", "main.xml", body, ' main_tree_to_execute="Main"')
    (tmp_path / "trees" / "link.xml").symlink_to(secret)
    with pytest.raises(TreeLoadError, match="search path"):
        load_tree(main)


def test_includes_in_a_circle_are_refused(tmp_path: Path) -> None:
    write(tmp_path, "a.xml", '<include path="b.xml"/>' + TREE.format("A", "<AlwaysSuccess/>"))
    write(tmp_path, "b.xml", '<include path="a.xml"/>' + TREE.format("B", "<AlwaysSuccess/>"))
    with pytest.raises(TreeLoadError, match=r"b\.xml:1: <include> 'path': 'a.xml' includes itself"):
        load_tree(tmp_path / "a.xml")


def test_an_error_in_an_included_file_names_that_file(tmp_path: Path) -> None:
    part = write(tmp_path, "part.xml", TREE.format("Part", "\n<Nope/>"))
    main = write(tmp_path, "main.xml", '<include path="part.xml"/>' + TREE.format("Main", "<AlwaysSuccess/>"))
    with pytest.raises(TreeLoadError, match=rf"{part}:2: <Nope>: unknown node"):
        load_tree(main)


def test_the_palette_is_what_groot2_imports(registry: NodeRegistry) -> None:
    text = palette_xml(registry)
    assert text.startswith('<root BTCPP_format="4">\n    <TreeNodesModel>\n')
    assert (
        '        <Action ID="Say">\n'
        '            <input_port name="words" type="std::vector&lt;std::string&gt;">what to say</input_port>\n'
        '            <input_port name="loud" type="bool" default="true"/>\n'
        '            <output_port name="said" type="double"/>\n'
        "            <description>Say something.</description>\n"
        "        </Action>\n"
    ) in text
    assert set(re.findall(r'<(?:Action|Condition|Control|Decorator) ID="(\w+)"', text)) == {"Say", *EXTENSIONS}


FULL = """<?xml version="1.0" encoding="UTF-8"?>
<!-- a tree -->
<root BTCPP_format="4" main_tree_to_execute="M">
    <!-- first, the <tree> -->
    <BehaviorTree ID="M">
        <Sequence name="two  spaces">
            <Script code="a := 'x &amp; y';&#10;b := 1 &lt; 2"/><!-- after -->
            <AlwaysSuccess/>
        </Sequence>
    </BehaviorTree>
    <?editor zoom="2"?>
    <TreeNodesModel>
        <SubTree ID="M"><![CDATA[ free <text> ]]></SubTree>
    </TreeNodesModel>
</root>
<!-- the end -->
"""


def test_a_file_is_written_back_as_it_was() -> None:
    assert XmlDocument.parse(FULL).to_xml() == FULL


def test_a_change_leaves_the_rest_of_the_file_alone() -> None:
    document = XmlDocument.parse(FULL)
    script = next(element for element in document.root.iter() if element.tag == "Script")
    script.attributes["name"] = "renamed"
    assert document.to_xml() == FULL.replace('2"/><!-- after', '2" name="renamed"/><!-- after')


@pytest.mark.parametrize("path", sorted((Path(__file__).parent / "bench_trees").glob("*.xml")), ids=lambda p: p.stem)
def test_large_files_are_written_back_as_they_were(path: Path) -> None:
    assert XmlDocument.load(path).to_xml().strip() == path.read_text().strip()


def test_the_tree_keeps_its_source(registry: NodeRegistry) -> None:
    text = ROOT.format("", TREE.format("M", '<Say words="a"/> <!-- kept -->'))
    assert load_tree(text, registry).xml == text


def test_what_only_the_parser_of_behavior_tree_cpp_accepts_is_a_warning(tmp_path: Path) -> None:
    body = '<!-- a -- b -->\n<Script code="a := 1 < 2 && 1"/>\n<AlwaysSuccess\nname="b"_skipIf="a>2"/>'
    file = write(tmp_path, "t.xml", TREE.format("M", f"<Sequence>\n{body}</Sequence>"))
    not_xml = "BehaviorTree.CPP accepts it, XML does not"
    what = {
        2: "a comment must not contain '--' or end with '-'",
        3: "'<' must be written '&lt;'",
        5: "no space before the attribute '_skipIf'",
    }
    places = [(line, f"{text}: {not_xml}") for line, text in what.items()]
    places[2:2] = [(3, f"'&' must be written '&amp;': {not_xml}")] * 2
    problems = [problem for problem in validate_file(file) if "XML" in problem.message]
    assert [(problem.line, problem.message, problem.severity) for problem in problems] == [
        (*place, "warning") for place in dict.fromkeys(places)
    ]
    converted = convert(file.read_bytes(), str(file))
    assert converted.notes == places
    assert b'code="a := 1 &lt; 2 &amp;&amp; 1"' in converted.data
    assert convert(converted.data, str(file)) == Converted(converted.data)


def test_a_real_fault_behind_a_tolerated_place_is_the_one_that_is_reported() -> None:
    text = ROOT.format("", TREE.format("M", '<Sequence>\n<Script code="a := 1 && 1"/>\n'))
    with pytest.raises(TreeLoadError, match="<text>:3: not well-formed XML: mismatched tag"):
        load_tree(text)


def test_the_bytes_of_another_encoding_are_not_rewritten() -> None:
    text = ROOT.format("", TREE.format("M", "<Script code=\"a := 'R&amp;D'\"/>"))
    for encoding in ("utf-16", "utf-8-sig", "utf-8"):
        tree = load_as(text.encode(encoding))
        assert tree == ["a := 'R&D'"]
        with pytest.raises(TreeLoadError, match="not well-formed XML") if encoding == "utf-16" else nullcontext():
            assert load_as(text.replace("&amp;", "&").encode(encoding)) == ["a := 'R&D'"]


def test_more_places_than_a_file_may_have_are_not_tolerated() -> None:
    with pytest.raises(TreeLoadError, match="not well-formed XML"):
        load_as(ROOT.format("", "&" * 20_000).encode())


def load_as(data: bytes) -> list[str]:
    """The scripts in a file."""
    return [element.attributes["code"] for element in parse_xml(data, "t.xml").iter() if "code" in element.attributes]
