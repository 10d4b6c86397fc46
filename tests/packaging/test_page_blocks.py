"""Every block of code of every page: trees, YAML and Python are valid, commands and their options exist.

What a block does when it runs is tested beside the code of its subject, and for the tutorials in test_tutorials.py.
"""

from __future__ import annotations

import ast
import importlib.util
import json
import re
import shlex
import textwrap
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import click
import pytest
import typer
import yaml

from bestman_bt.cli.main import VERBS, app
from bestman_bt.engine import load_tree
from bestman_bt.runtime.plugins import node_registry

CHECKOUT = Path(__file__).resolve().parents[2]
PAGES = [*sorted((CHECKOUT / "docs").rglob("*.md")), CHECKOUT / "README.md", CHECKOUT / "CONTRIBUTING.md"]
OURS = ("bestman_bt", "behaviours", "hal")
FENCE = re.compile(r"^( *)```(\w*)\n(.*?)^\1```", re.MULTILINE | re.DOTALL)
OWN_NODES = {"Glance", "ReadTemperature"}
"""Nodes that pages define."""


def named(path: Path) -> str:
    return str(path.relative_to(CHECKOUT))


def blocks(path: Path, *languages: str) -> list[str]:
    return [textwrap.dedent(body) for _, kind, body in FENCE.findall(path.read_text()) if kind in languages]


def pages_with(*languages: str) -> Any:
    return pytest.mark.parametrize("path", [page for page in PAGES if blocks(page, *languages)], ids=named)


@pages_with("xml")
def test_the_trees_load_and_the_parts_of_trees_are_well_formed(path: Path) -> None:
    for text in blocks(path, "xml"):
        root = ElementTree.fromstring(f"<page>{re.sub(r'<[?]xml.*?[?]>', '', text)}</page>")
        tags = {element.tag for element in root.iter()}
        if "BehaviorTree" in tags and not tags & OWN_NODES and root[0].tag == "root":
            assert load_tree(text, node_registry()).nodes


@pages_with("yaml", "json", "toml")
def test_the_data_can_be_read(path: Path) -> None:
    for text in blocks(path, "yaml"):
        assert list(yaml.safe_load_all(text))
    for text in blocks(path, "json"):
        assert json.loads(text) is not None
    for text in blocks(path, "toml"):
        assert tomllib.loads(text)


@cache
def names_of(module: str) -> set[str] | None:
    """What a module of ours defines or imports at its top, and its submodules; None if there is no such module."""
    try:
        found = importlib.util.find_spec(module)
    except ModuleNotFoundError:
        return None
    if found is None:
        return None
    names = {child.stem for folder in found.submodule_search_locations or () for child in Path(folder).iterdir()}
    if found.origin is None:
        return names
    for node in ast.walk(ast.parse(Path(found.origin).read_text())):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            names |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
    return names


def imported(text: str) -> Iterator[tuple[str, str | None]]:
    """(module, name) of each import of ours; the name is None for ``import module``."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from ((node.module, alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from ((alias.name, None) for alias in node.names)


@pages_with("python")
def test_the_programs_compile_and_import_what_there_is(path: Path) -> None:
    for text in blocks(path, "python"):
        for module, name in imported(text):
            if module.partition(".")[0] in OURS:
                names = names_of(module)
                assert names is not None, f"there is no module {module}"
                assert name is None or name in names, f"{module} has no {name}"


def command_lines(path: Path) -> Iterator[str]:
    """What is typed: lines of shell blocks and of indented blocks, and ``code`` that is a whole command."""
    text = path.read_text()
    for body in blocks(path, "bash", "console", "text"):
        yield from body.replace("\\\n", " ").splitlines()
    without = FENCE.sub("", text)
    yield from re.findall(r"^ {4}(?!- |\|)(\S.*)$", without, re.MULTILINE)
    yield from re.findall(r"`((?:bestman-bt|make|python) [^`]+)`", without)


@cache
def verb(name: str) -> Any:
    group: Any = typer.main.get_command(app)
    return group.get_command(click.Context(group), name)


def fault_of(line: str) -> str:
    """Why this call of the command line is refused before it begins; '' if it is not."""
    words = shlex.split(line, comments=True)
    ends = [n for n, word in enumerate(words) if word in ("&&", ";", "|", "||", ">", "2>", "<", "\\")]
    words = words[1 : ends[0] if ends else None]
    if not words or words[0] in ("…", "...", "--help"):
        return ""
    if words[0] not in VERBS:
        return f"unknown command {words[0]}"
    command, rest = verb(words[0]), words[1:]
    if isinstance(command, click.Group) or hasattr(command, "commands"):
        if not rest:
            return ""
        if rest[0] not in command.commands:
            return f"unknown command {words[0]} {rest[0]}"
        command, rest = command.commands[rest[0]], rest[1:]
    if rest and rest[-1] in ("…", "..."):
        del rest[-1]
    try:
        command.make_parser(command.context_class(command)).parse_args([*rest])
    except Exception as error:  # noqa: BLE001 - typer brings a click of its own, whose errors share no name with click's
        message = str(getattr(error, "message", error))
        # `run --driver` alone names an option; `--set …` leaves its value out.
        return "" if "requires an argument" in message and rest[-1].startswith("-") else message
    return ""


def calls(path: Path) -> Iterator[str]:
    """The calls of ``bestman-bt`` that a page shows."""
    for line in command_lines(path):
        found = re.search(r"(?:^|&& |then |; |\s)(?:\S*/bin/)?(bestman-bt .*)$", line.removeprefix("$ "))
        if found and not line.startswith(("#", "bestman-bt: ")):
            yield found[1]


@pytest.mark.slow
@pytest.mark.parametrize("path", [page for page in PAGES if list(calls(page))], ids=named)
def test_the_commands_and_their_options_exist(path: Path) -> None:
    wrong = {line: fault for line in calls(path) if (fault := fault_of(line))}
    assert wrong == {}


def test_the_check_of_commands_finds_what_is_wrong() -> None:
    assert fault_of("bestman-bt run fetch_cup --seed 7") == ""
    assert "unknown" in fault_of("bestman-bt rum fetch_cup")
    assert "--sed" in fault_of("bestman-bt run fetch_cup --sed 7")
    assert "unknown command robot shw" in fault_of("bestman-bt robot shw diff_panda")


def test_scripts_and_make_targets_that_pages_name_exist() -> None:
    targets = set(re.findall(r"^([\w-]+):", (CHECKOUT / "Makefile").read_text(), re.MULTILINE))
    for path in PAGES:
        for line in command_lines(path):
            made = re.match(r"(?:\$ )?make ([a-z][\w-]*)", line)
            assert not made or made[1] in targets, f"{named(path)}: {line}"
            for script in re.findall(r"\b((?:benchmarks|scripts|tests|examples)/[\w/]+\.py)\b", line):
                assert (CHECKOUT / script).exists(), f"{named(path)}: {line}"


def test_the_pages_of_the_api_have_every_public_name() -> None:
    documented = {"bestman_bt.engine": "engine", "hal.api": "hal", "bestman_bt.messages": "messages"}
    for module, page in documented.items():
        text = (CHECKOUT / "docs/api" / f"{page}.md").read_text()
        public = set(importlib.import_module(module).__all__)
        shown = set(re.findall(rf"^::: {re.escape(module)}\.(\w+)$", text, re.MULTILINE))
        said = set(re.findall(r"`(\w+)`", text))
        assert public - shown - said == set(), f"docs/api/{page}.md"
        assert shown - public == set(), f"docs/api/{page}.md"


def test_the_pages_of_the_api_name_what_there_is() -> None:
    for path in (CHECKOUT / "docs/api").glob("*.md"):
        for module, name in re.findall(r"^::: ([\w.]+)\.(\w+)$", path.read_text(), re.MULTILINE):
            assert name in (names_of(module) or ()), f"{named(path)}: {module} has no {name}"


def test_the_facade_is_documented_where_it_is_defined() -> None:
    import bestman_bt as bt

    text = (CHECKOUT / "docs/api/bestman_bt.md").read_text()
    assert {
        name for name in bt.__all__ if not re.search(rf"^::: bestman_bt\.[\w.]+\.{name}$", text, re.MULTILINE)
    } == set()
