"""YAML documents remember where their values were written, through merging too."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration.document import Document, parse_document, parse_value, read_document
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.task import load_task
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.scene.load import load_scene

BELOW = """\
a: 1
b:
  c: [10, 20]
  d: text
"""
ABOVE = """\
b:
  c: [30]
e: new
"""
ALIASES = "a0: &a0 [1, 1, 1, 1]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12))


def test_every_value_knows_its_line() -> None:
    document = parse_document(BELOW, "below.yaml")
    assert document.origin(("b", "c", 1)) == ("below.yaml", 3)
    assert document.origin(("b", "d")) == ("below.yaml", 4)
    assert document.origin(("b", "unknown")) == ("below.yaml", 2)


def test_merging_keeps_values_below_and_the_origins_of_both() -> None:
    merged = parse_document(BELOW, "below.yaml").merged(parse_document(ABOVE, "above.yaml"))
    assert merged.data == {"a": 1, "b": {"c": [30], "d": "text"}, "e": "new"}
    assert merged.origin(("b", "c", 0)) == ("above.yaml", 2)
    assert merged.origin(("b", "d")) == ("below.yaml", 4)
    assert merged.origin(("e",)) == ("above.yaml", 3)


def test_a_part_of_a_document_keeps_where_it_was_written() -> None:
    part = parse_document(BELOW, "below.yaml").below("b")
    assert part.data == {"c": [10, 20], "d": "text"}
    assert part.origins.keys() == {(), ("c",), ("c", 0), ("c", 1), ("d",)}
    assert part.origin(("c", 1)) == ("below.yaml", 3)
    assert part.origin(("unknown",)) == ("below.yaml", 2)
    laid = Document({"b": {"e": 1}}, {(): ("--set", None)})
    assert laid.below("b").origin(("e",)) == ("--set", None)


def test_where_a_list_is_replaced_its_items_are_the_new_ones_and_what_is_beside_it_stays() -> None:
    below = parse_document(BELOW, "below.yaml")
    replaced = below.merged(Document({"b": {"c": [1, 2]}}, {("b", "c"): ("--set b.c=[1, 2]", None)}))
    assert replaced.origin(("b", "c", 1)) == ("--set b.c=[1, 2]", None)
    assert replaced.origin(("b", "d")) == ("below.yaml", 4)
    assert replaced.origin(("a",)) == ("below.yaml", 1)
    for text, value in (("b: 3\n", 3), ("b: null\n", None), ("b: [1]\n", [1])):
        assert below.merged(parse_document(text, "above.yaml")).data["b"] == value
    assert parse_document("b: 3\n", "x.yaml").merged(below).data["b"] == {"c": [10, 20], "d": "text"}
    assert replaced.merged(parse_document("e: 1\n", "above.yaml")).origin(("unknown",)) == ("above.yaml", 1)


def test_names_that_are_given_twice_can_be_gathered_and_the_later_counts() -> None:
    faults: list[Problem] = []
    document = parse_document("a: 1\nb: {c: 1, c: 2}\na: 3\n", "x.yaml", faults)
    assert document.data == {"a": 3, "b": {"c": 2}}
    assert [str(fault) for fault in faults] == ["x.yaml:2: b.c: is given twice", "x.yaml:3: a: is given twice"]
    with pytest.raises(ConfigurationError, match="contains itself"):
        parse_document("a: &a [*a]\n", "x.yaml", faults)


@pytest.mark.slow
def test_a_value_of_the_command_line_is_yaml_or_refused_in_a_line() -> None:
    assert [parse_value(text) for text in ("3", "1e-3", "yes", "[a, 2]", "")] == [3, 0.001, "yes", ["a", 2], None]
    for text in ("[1", "\x00", "[" * 5000):
        with pytest.raises(ValueError, match="the value is not YAML: [^\n]*$"):
            parse_value(text)


def test_a_file_below_the_working_directory_is_named_from_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "x.yaml").write_text("a: 1\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert read_document(tmp_path / "x.yaml").origin(("a",)) == ("x.yaml", 1)
    assert read_document(Path("x.yaml")).origin(("a",)) == ("x.yaml", 1)


def test_merging_leaves_the_merged_documents_alone() -> None:
    below, above = parse_document(BELOW, "below.yaml"), parse_document(ABOVE, "above.yaml")
    below.merged(above).data["b"]["c"].append(99)
    assert below.data["b"]["c"] == [10, 20]
    assert above.data["b"]["c"] == [30]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [1\nb: 2\n", "x.yaml:2: is not YAML: expected ',' or ']', but got ':'"),
        ("- a\n- b\n", "x.yaml:1: should hold fields (name: value), got list"),
        ("a: 1\nb: 2\na: 3\n", "x.yaml:3: a: is given twice"),
        ("[a, b]: 1\n", "x.yaml:1: a name should be text"),
        ("a: !!python/object/apply:os.system [true]\n", "x.yaml:1: is not YAML: could not determine a constructor"),
        ("a: \x00\n", "x.yaml: is not YAML"),
        ("a: &a [*a]\n", "x.yaml:1: a[0]: contains itself"),
        ("a: " + "[" * 5000 + "]" * 5000 + "\n", "x.yaml: is nested too deeply"),
        ("a: " + "1" * 5000 + "\n", "x.yaml: holds a value that cannot be read: Exceeds the limit"),
        (ALIASES, "x.yaml: holds more than 100000 values"),
    ],
)
def test_what_is_no_mapping_in_yaml_is_refused_with_its_line(text: str, message: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        parse_document(text, "x.yaml")
    assert message in str(error.value)


def test_words_are_not_taken_for_booleans() -> None:
    document = parse_document("on: yes\nno: off\nflag: true\nday: 2026-11-21\n", "x.yaml")
    assert document.data == {"on": "yes", "no": "off", "flag": True, "day": "2026-11-21"}


def test_exponents_are_numbers_without_a_point_too() -> None:
    assert parse_document("a: 1e-3\n", "x.yaml").data == {"a": 0.001}


def test_a_file_that_is_not_text_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_bytes(b"a: 1\nb: \xff\n")
    with pytest.raises(ConfigurationError, match=r"x\.yaml:2: is not UTF-8 text \(byte 0xff\): save the file as UTF-8"):
        read_document(path)


def test_an_empty_file_is_an_empty_mapping(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text("")
    assert read_document(path).data == {}


@pytest.mark.parametrize("text", ["", "# nothing but a comment\n"])
def test_what_is_missing_in_an_empty_file_is_reported_with_the_name_of_the_file(text: str, tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(text)
    assert str(read_document(path).problem(("tree",), "is missing")) == f"{path}: tree: is missing"
    for load in (load_task, load_scene, load_robot_model):
        with pytest.raises(ConfigurationError) as error:
            load(path)
        assert all(str(problem).startswith(f"{path}: ") for problem in error.value.problems)
