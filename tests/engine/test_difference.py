"""What changed between two tree files."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from bestman_bt.engine.models.difference import compare, difference_svg, differences
from bestman_bt.engine.xml.documents import read_documents


def told(before: str, after: str) -> list[str]:
    texts = [
        f'<root BTCPP_format="4">\n<BehaviorTree ID="Main">\n{body}\n</BehaviorTree></root>' for body in (before, after)
    ]
    return [str(one) for one in differences(compare(*map(read_documents, texts)))]


CASES = {
    "nothing": ("<A x='1'/>", "<A   x='1'></A>", []),
    "a port": (
        "<A x='1' y='2'/>", "<A x='3' z='4'/>", ['changed  A (line 3 → 3): x "1" → "3", y "2" → none, z none → "4"'],
    ),
    "an added leaf": ("<S>\n<A/>\n<B/></S>", "<S>\n<A/>\n<C/>\n<B/></S>", ["added    S > C (line 5)"]),
    "a removed branch is one line": ("<S><A/><F><B/><C/></F></S>", "<S><A/></S>", ["removed  S > F (line 3)"]),
    "a moved leaf": ("<S><A/><F><B/></F></S>", "<S><F><B/><A/></F></S>", ["moved    S > F > A (line 3 → 3)"]),
    "a wrapped leaf": (
        "<S><A/><B/></S>", "<S><R><A/></R><B/></S>", ["added    S > R (line 3)", "moved    S > R > A (line 3 → 3)"],
    ),
    "a moved and changed one": (
        "<S><A name='a' x='1'/><F><B/></F></S>",
        "<S><F><B/><A name='a' x='2'/></F></S>",
        ["moved    S > F > A 'a' (line 3 → 3): x \"1\" → \"2\""],
    ),
    "another type": ("<S><A/></S>", "<S><B/></S>", ["removed  S > A (line 3)", "added    S > B (line 3)"]),
    "of equal leaves the ends stay": ("<S><A/><A/></S>", "<S><A/><A/><A/></S>", ["added    S > A (line 3)"]),
}  # fmt: skip


@pytest.mark.parametrize(("before", "after", "expected"), CASES.values(), ids=CASES)
def test_what_changed_is_reported(before: str, after: str, expected: list[str]) -> None:
    assert told(before, after) == expected


def test_trees_that_come_and_go_are_reported_as_a_whole_and_drawn() -> None:
    one, two = (
        f'<root BTCPP_format="4"><BehaviorTree ID="{name}"><S><A/></S></BehaviorTree>'
        '<BehaviorTree ID="Same"><A/></BehaviorTree></root>'
        for name in ("Old", "New")
    )
    trees = compare(read_documents(one), read_documents(two))
    assert [(one.kind, one.tree) for one in differences(trees) if one.path == "the whole tree"] == [
        ("removed", "Old"),
        ("added", "New"),
    ]
    svg = difference_svg(trees, "t")
    assert "BehaviorTree Same" not in svg
    assert ElementTree.fromstring(svg).tag.endswith("svg")
