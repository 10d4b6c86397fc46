"""What a contributor expects beside the code: it parses, and what it calls exists."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml
from packaging.requirements import Requirement

from tests.packaging.test_lock import direct_requirements

CHECKOUT = Path(__file__).resolve().parents[2]
TARGETS = set(re.findall(r"^([a-z][a-z-]*):", (CHECKOUT / "Makefile").read_text(), re.MULTILINE))
TOOL_OF = {"lint-imports": "import-linter"}
"""Program → the distribution that brings it, where it is called otherwise."""


def parsed(name: str) -> Any:
    return yaml.safe_load((CHECKOUT / name).read_text())


def called_targets(commands: str) -> list[str]:
    """The targets of make, without its variables."""
    lines = re.findall(r"^make (.+)$", commands, re.MULTILINE)
    return [word for line in lines for word in line.split() if "=" not in word]


def workflow_commands() -> str:
    job = parsed(".github/workflows/ci.yml")["jobs"]["test"]
    return "\n".join(step["run"] for step in job["steps"] if "run" in step)


@pytest.mark.parametrize("commands", [workflow_commands(), (CHECKOUT / ".ci/run").read_text()], ids=["github", "ci"])
def test_both_checks_run_the_quick_tests_and_then_all(commands: str) -> None:
    called = called_targets(commands)
    assert [target for target in called if target.startswith("test")] == ["test", "test-all"]
    assert set(called) <= TARGETS


def test_the_workflow_runs_on_the_supported_pythons_and_requires_the_browser() -> None:
    job, others = parsed(".github/workflows/ci.yml")["jobs"].values()
    versions = [step["with"]["python-version"] for step in job["steps"] if "python-version" in step.get("with", {})]
    versions += others["strategy"]["matrix"]["python-version"]
    supported = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]["classifiers"]
    assert versions == [text.rpartition(" ")[2] for text in supported if text.startswith("Programming Language")]
    assert job["env"] == {"BROWSER_TESTS": "required"}


def test_the_hooks_are_the_checks_of_make_lint_with_the_locked_tools() -> None:
    (repository,) = parsed(".pre-commit-config.yaml")["repos"]
    assert repository["repo"] == "local"
    programs = [hook["entry"].split()[0] for hook in repository["hooks"]]
    locked = {Requirement(text).name for text in direct_requirements()}
    for program in programs:
        folder, _, name = program.rpartition("/")
        assert folder == ".venv/bin"
        assert name == "python" or TOOL_OF.get(name, name) in locked
    recipes = re.findall(
        r"^(?:lint|style|types|contracts):.*\n((?:\t.+\n)+)", (CHECKOUT / "Makefile").read_text(), re.MULTILINE
    )
    checks = {tool for recipe in recipes for tool in re.findall(r"\$\(BIN\)/(\S+)", recipe)}
    assert checks == {program.rpartition("/")[2] for program in programs}


def test_updates_are_looked_for_where_requirements_are() -> None:
    manifests = {"pip": "pyproject.toml", "npm": "package.json", "github-actions": ".github/workflows/ci.yml"}
    entries = parsed(".github/dependabot.yml")["updates"]
    assert {entry["package-ecosystem"] for entry in entries} == set(manifests)
    for entry in entries:
        folder = CHECKOUT / entry["directory"].lstrip("/")
        assert (folder / manifests[entry["package-ecosystem"]]).is_file()
