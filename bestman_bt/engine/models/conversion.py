"""Conversion of tree files of BehaviorTree.CPP 3 to version 4, following its migration guide.

The text changes only where a name or form differs: comments, order, white space and quotes are preserved.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

from bestman_bt.engine.errors import TreeLoadError, TreeProblem
from bestman_bt.engine.xml.documents import RENAMED, SIGNS, find_py_trees_element, old_version
from bestman_bt.engine.xml.elements import Element, parse_xml, run_parser, safe_parser
from bestman_bt.engine.xml.writer import escape

_PORTS: Final = {
    ("Parallel", "success_threshold"): "success_count",
    ("Parallel", "failure_threshold"): "failure_count",
    ("Parallel", "threshold"): "success_count",
    ("SubTreePlus", "__autoremap"): "_autoremap",
}
_SCRIPTS: Final = frozenset(
    ("_failureIf", "_successIf", "_skipIf", "_while", "_onHalted", "_onSuccess", "_onFailure", "_post", "_autoremap")
)
_ATTRIBUTE: Final = re.compile(rb"(\s+)([^\s=/>]+)(\s*=\s*)(\"[^\"]*\"|'[^']*')")
_START_TAG: Final = re.compile(rb"<(?:[^>\"']++|\"[^\"]*+\"|'[^']*+')*+>")
_TRUE: Final = ("true", "1")
_KEY: Final = re.compile(r"[@A-Za-z_]\w*", re.ASCII)
"""A key that a script can name."""
_OPERAND: Final = re.compile(r"-?[\w.]+", re.ASCII)


@dataclass(frozen=True)
class Converted:
    """A file converted to version 4: its bytes, and points to check by hand, as (line, text)."""

    data: bytes
    notes: list[tuple[int, str]] = field(default_factory=list)


@dataclass
class _Tag:
    """A start tag in the bytes of a file: its position and its replacement."""

    name: str
    attributes: dict[str, str]
    line: int
    start: int
    end: int
    new_name: str
    renamed: dict[str, tuple[str, str]] = field(default_factory=dict)
    removed: set[str] = field(default_factory=set)
    added: dict[str, str] = field(default_factory=dict)


def convert(data: bytes, file: str) -> Converted:
    """Return a file converted to version 4; a file of version 4 that is XML is returned unchanged.

    Constructs that only BehaviorTree.CPP's parser accepts are written as valid XML, with a note for each place.

    Raises:
        TreeLoadError: it is not well-formed XML, it is a file of py_trees, or its encoding is not a superset of ASCII.
    """
    notes: list[tuple[int, str]] = []
    edits: list[tuple[int, int, bytes]] = []
    open_tags: list[_Tag] = []
    depth_of_models = 0
    is_old = True
    parser, data, tolerated = safe_parser(data, file)
    notes.extend(tolerated)
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise TreeLoadError([TreeProblem(file, 1, "", "", "the file is in UTF-16; save it as UTF-8 to convert it")])
    _refuse_py_trees(parse_xml(data, file), file)

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth_of_models, is_old
        at = parser.CurrentByteIndex
        tag = _Tag(name, attributes, parser.CurrentLineNumber, at, _end_of_tag(data, at), name)
        depth_of_models += name == "TreeNodesModel"
        if not open_tags:
            is_old = attributes.get("BTCPP_format") != "4"
            if is_old:
                _root(tag)
        elif is_old and not depth_of_models:
            notes.extend((tag.line, words) for words in _node(tag))
        open_tags.append(tag)
        if tag.new_name != name or tag.renamed or tag.removed or tag.added:
            edits.append((tag.start, tag.end, _rewritten(data[tag.start : tag.end], tag)))

    def end(name: str) -> None:
        nonlocal depth_of_models
        tag = open_tags.pop()
        depth_of_models -= name == "TreeNodesModel"
        at = parser.CurrentByteIndex
        if tag.new_name != name and data[tag.end - 2 : tag.end] != b"/>":
            edits.append((at + 2, at + 2 + len(name.encode()), tag.new_name.encode()))

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    run_parser(parser, data, file)
    for at, until, text in sorted(edits, reverse=True):
        data = data[:at] + text + data[until:]
    return Converted(data, notes)


def _refuse_py_trees(root: Element, file: str) -> None:
    sign = find_py_trees_element(root)
    if sign is not None and old_version(root, file) is None:
        what = "this is py_trees' format: it is read as it is, and has no conversion"
        raise TreeLoadError([TreeProblem(file, sign.line, sign.tag, "", what)])


def _end_of_tag(data: bytes, start: int) -> int:
    """Return the place behind the ``>`` that ends a start tag; one between quotes does not."""
    found = _START_TAG.match(data, start)
    assert found is not None, "expat has read it"
    return found.end()


def _root(tag: _Tag) -> None:
    if "BTCPP_format" in tag.attributes:
        tag.renamed["BTCPP_format"] = ("BTCPP_format", "4")
    else:
        tag.added["BTCPP_format"] = "4"


def _node(tag: _Tag) -> Iterator[str]:
    """Decide the conversion of a node; yields points to check by hand."""
    kind = tag.name
    if tag.name in ("Action", "Condition", "Control", "Decorator"):
        kind = tag.attributes.get("ID", "")
        if kind in RENAMED:
            tag.renamed["ID"] = ("ID", RENAMED[kind])
    elif tag.name in RENAMED:
        tag.new_name = RENAMED[tag.name]
    for key, value in tag.attributes.items():
        other = _PORTS.get((kind, key))
        if other is not None:
            tag.renamed[key] = (other, value)
        elif key in _SCRIPTS and kind != "SubTreePlus":
            yield f"the port '{key}' of {kind} is a script in version 4: give it another name"
    if kind == "SubTree":
        yield from _subtree(tag)
    elif kind in SIGNS - RENAMED.keys():
        yield from _check(tag, kind)
    elif kind == "FallbackStar":
        yield "FallbackStar has no name in version 4: a Fallback resumes at the child that runs"


def _subtree(tag: _Tag) -> Iterator[str]:
    for key, value in tag.attributes.items():
        if key == "__shared_blackboard":
            tag.removed.add(key)
            if value.lower() in _TRUE:
                tag.added["_autoremap"] = "true"
                what = "had the blackboard of its parent; now it has one of its own, with _autoremap"
                yield f"the SubTree '{tag.attributes.get('ID')}' {what}"
        elif key not in ("ID", "name") and not (value.startswith("{") and value.endswith("}")):
            if value:
                tag.renamed[key] = (key, f"{{{value}}}")
            else:
                yield f"the SubTree '{tag.attributes.get('ID')}' maps '{key}' to nothing"


def _check(tag: _Tag, kind: str) -> Iterator[str]:
    """Convert BlackboardCheck… to a Precondition of version 4, if one side is an entry."""
    one, two = (tag.attributes.get(key, "") for key in ("value_A", "value_B"))
    if not (one.startswith("{") and one.endswith("}")):
        one, two = two, one
    if tag.name != kind or not (one.startswith("{") and one.endswith("}")) or not two or "'" in two:
        yield f"{kind} is not in version 4: write a <Precondition> or _skipIf"
        return
    is_entry = two.startswith("{") and two.endswith("}")
    for text, form in ((one[1:-1], _KEY), (two[1:-1], _KEY) if is_entry else (two, _OPERAND)):
        if form.fullmatch(text) is None and not (form is _OPERAND and kind.endswith("String")):
            yield f"{kind} is not in version 4, and no script can have '{text}': rewrite it by hand"
            return
    other = two[1:-1] if is_entry else f"'{two}'" if kind.endswith("String") else two
    tag.new_name = "Precondition"
    tag.removed |= {"value_A", "value_B", "return_on_mismatch"}
    tag.added["if"] = f"{one[1:-1]} == {other}"
    tag.added["else"] = tag.attributes.get("return_on_mismatch", "FAILURE")
    yield f"{kind} has become a Precondition: see whether the entry '{one[1:-1]}' holds a value of that type"


def _rewritten(text: bytes, tag: _Tag) -> bytes:
    def attribute(match: re.Match[bytes]) -> bytes:
        space, name, equals, value = match.groups()
        key = name.decode("utf-8", "replace")
        if key in tag.removed:
            return b""
        if key not in tag.renamed:
            return match.group()
        new_key, new_value = tag.renamed[key]
        if new_value == f"{{{tag.attributes[key]}}}":
            value = value[:1] + b"{" + value[1:-1] + b"}" + value[:1]
        elif new_value != tag.attributes[key]:
            value = value[:1] + _in_any_encoding(escape(new_value).replace("'", "&apos;")) + value[:1]
        return space + new_key.encode() + equals + value

    head = 1 + len(tag.name.encode())
    tail = 2 if text.endswith(b"/>") else 1
    body = _ATTRIBUTE.sub(attribute, text[head:-tail])
    rest = body[len(body.rstrip()) :]
    extra = "".join(f' {key}="{escape(value)}"' for key, value in tag.added.items())
    return b"<" + tag.new_name.encode() + body.rstrip() + _in_any_encoding(extra) + rest + text[-tail:]


def _in_any_encoding(text: str) -> bytes:
    return text.encode("ascii", "xmlcharrefreplace")
