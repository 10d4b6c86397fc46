"""Files of BehaviorTree.CPP 3: recognised, and converted with nothing else changed."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration.data import shipped_trees
from bestman_bt.engine import TreeLoadError, XmlDocument, load_tree
from bestman_bt.engine.models.conversion import convert
from bestman_bt.engine.models.foreign import open_tree
from bestman_bt.engine.validation import validate_file
from bestman_bt.engine.xml.document import canonical
from bestman_bt.engine.xml.elements import Element, parse_xml


def converted(body: str, head: str = "<root>") -> tuple[str, list[str]]:
    result = convert(f'{head}<BehaviorTree ID="Main">{body}</BehaviorTree></root>'.encode(), "t.xml")
    text = result.data.decode()
    start = text.index('"Main">') + 7
    return text[start : text.rindex("</BehaviorTree>")], [words for _, words in result.notes]


CASES = {
    "a control node": (
        "<SequenceStar name='s'>\n <A/></SequenceStar>", "<SequenceWithMemory name='s'>\n <A/></SequenceWithMemory>",
    ),
    "the explicit form": (
        '<Control ID="SequenceStar"><A/></Control>', '<Control ID="SequenceWithMemory"><A/></Control>',
    ),
    "a misspelt decorator": (
        '<RetryUntilSuccesful num_attempts="3"><A/></RetryUntilSuccesful>',
        '<RetryUntilSuccessful num_attempts="3"><A/></RetryUntilSuccessful>',
    ),
    "a remapped port": ('<SubTree ID="B"  to="goal"\n x=\'{y}\' />', '<SubTree ID="B"  to="{goal}"\n x=\'{y}\' />'),
    "SubTreePlus": ('<SubTreePlus ID="B" __autoremap="true" to="3"/>', '<SubTree ID="B" _autoremap="true" to="3"/>'),
    "thresholds": (
        '<Parallel success_threshold="2" failure_threshold="1"><A/></Parallel>',
        '<Parallel success_count="2" failure_count="1"><A/></Parallel>',
    ),
    "what stays": ('<A x="a &gt; b" y="SequenceStar"/><!-- <SequenceStar/> -->', None),
}  # fmt: skip


@pytest.mark.parametrize(("body", "expected"), CASES.values(), ids=CASES)
def test_what_has_another_name_is_written_and_nothing_else(body: str, expected: str | None) -> None:
    assert converted(body) == (body if expected is None else expected, [])


def test_what_a_person_should_look_at_is_reported_with_its_line() -> None:
    text, notes = converted('<SubTree ID="B" __shared_blackboard="true"/>')
    assert text == '<SubTree ID="B" _autoremap="true"/>'
    assert "had the blackboard of its parent" in notes[0]
    text, notes = converted(
        '<BlackboardCheckString value_A="{n}" value_B="it" return_on_mismatch="SUCCESS"><A/></BlackboardCheckString>'
    )
    assert text == """<Precondition if="n == 'it'" else="SUCCESS"><A/></Precondition>"""
    assert "has become a Precondition" in notes[0]
    assert "is a script in version 4" in converted('<A _while="3"/>')[1][0]
    assert convert(b'<root>\n<BehaviorTree ID="A">\n<A _post="3"/></BehaviorTree></root>', "t.xml").notes[0][0] == 3


@pytest.mark.parametrize(
    "node",
    [
        '<BlackboardCheckString value_A="{s.x y}" value_B="it"><A/></BlackboardCheckString>',
        '<BlackboardCheckInt value_A="{n}" value_B="{a-b}"><A/></BlackboardCheckInt>',
        '<BlackboardCheckInt value_A="{n}" value_B="1 2"><A/></BlackboardCheckInt>',
    ],
)
def test_a_check_that_no_script_can_express_stays_with_a_note(node: str) -> None:
    text, notes = converted(node)
    assert text == node
    assert "rewrite it by hand" in notes[0]


def test_a_file_of_py_trees_is_refused() -> None:
    tree = b'<root><BehaviorTree ID="Main"><Selector memory="false"><A/></Selector></BehaviorTree></root>'
    with pytest.raises(TreeLoadError, match="<Selector>: this is py_trees' format"):
        convert(tree, "t.xml")


def test_the_format_is_added_and_models_stay() -> None:
    text = b"<root>\n<TreeNodesModel><Action ID='SequenceStar'/></TreeNodesModel></root>"
    assert convert(text, "t.xml").data == text.replace(b"<root>", b'<root BTCPP_format="4">')
    assert convert(b'<root BTCPP_format="3"/>', "t.xml").data == b'<root BTCPP_format="4"/>'


def test_a_file_keeps_its_encoding() -> None:
    check = '<BlackboardCheckString value_A="{s}" value_B="été"><A/></BlackboardCheckString>'
    body = f'<Sequence><SubTree ID="B" to="été &amp; co"/>{check}</Sequence>'
    text = f'<?xml version="1.0" encoding="iso-8859-1"?><root><BehaviorTree ID="M">{body}</BehaviorTree></root>'
    data = convert(text.encode("latin-1"), "t.xml").data
    assert b' to="{' + "été".encode("latin-1") + b' &amp; co}"' in data
    subtree, precondition = parse_xml(data, "t.xml").children[0].children[0].children
    assert subtree.attributes["to"] == "{été & co}"
    assert precondition.attributes["if"] == "s == 'été'"


def test_files_of_version_4_come_back_byte_for_byte() -> None:
    files = [file for folder in shipped_trees() for file in folder.rglob("*.xml")]
    assert len(files) > 10
    assert all(convert(file.read_bytes(), str(file)).data == file.read_bytes() for file in files)
    odd = (
        '\ufeff<?xml version="1.0"?>\r\n<root   BTCPP_format = "4"\t>\r\n<A></A><!-- SubTreePlus --></root >\n'.encode()
    )
    assert convert(odd, "t.xml").data == odd


def test_the_canonical_form_says_the_same_and_is_its_own() -> None:
    def shape(element: Element) -> object:
        return element.tag, element.attributes, [shape(child) for child in element.children]

    for file in (file for folder in shipped_trees() for file in folder.rglob("*.xml")):
        text = canonical(XmlDocument.load(file))
        assert shape(parse_xml(text, "t")) == shape(parse_xml(file.read_bytes(), "t"))
        assert canonical(XmlDocument.parse(text)) == text


def test_a_file_of_version_3_is_reported_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "t.xml"
    path.write_text('<root>\n<BehaviorTree ID="Main">\n<SequenceStar><A/><B/></SequenceStar></BehaviorTree></root>')
    (problem,) = validate_file(path)
    told = f"{path}:3: the file is in the format of BehaviorTree.CPP 3 ('SequenceStar')"
    assert str(problem) == f"{told} (convert it with: bestman-bt convert {path})"
    for load in (load_tree, open_tree):
        with pytest.raises(TreeLoadError, match="is in the format of BehaviorTree.CPP 3") as error:
            load(path)
        assert len(error.value.problems) == 1
    for sign in ("failure_threshold", "threshold"):
        parallel = f'<Parallel {sign}="1"><A/><B/></Parallel>'
        (tmp_path / "p.xml").write_text(f"<root><BehaviorTree>{parallel}</BehaviorTree></root>")
        assert f"3 ('{sign}')" in str(validate_file(tmp_path / "p.xml")[0])
    path.write_bytes(convert(path.read_bytes(), "t.xml").data)
    assert open_tree(path).tree_id == "Main"


def test_what_is_no_xml_or_of_another_encoding_is_refused() -> None:
    with pytest.raises(TreeLoadError, match=r"t\.xml:1: not well-formed"):
        convert(b"<root", "t.xml")
    with pytest.raises(TreeLoadError, match="UTF-16"):
        convert("<root/>".encode("utf-16"), "t.xml")
