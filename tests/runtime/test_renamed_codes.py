"""Trees and suites that name a failure code by its earlier name are told the new one, with their line."""

from __future__ import annotations

from pathlib import Path

import pytest

from behaviours.skill import InstantSkill
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.engine import load_tree
from bestman_bt.evaluation.suite import load_suite
from bestman_bt.runtime.failure_lines import renamed_codes
from bestman_bt.runtime.plugins import node_registry
from tests.behaviours.at_the_table import tree_of

CASES = '<Switch2 variable="{code}" case_1="hand_full" case_2="lost">' + 3 * "<AlwaysSuccess/>" + "</Switch2>"


class Peek(InstantSkill):
    """A skill of a user, with a code of its own."""

    FAILS = {"not_seen": "Peek again"}

    def act(self) -> None:
        """There is nothing to do."""


def told(body: str) -> list[str]:
    registry = node_registry([])
    registry.register(Peek)
    return [str(problem) for problem in renamed_codes(load_tree(tree_of(body), registry))]


@pytest.mark.parametrize(
    ("node", "old", "new"),
    [
        ("<ScriptCondition code=\"code == 'not_seen'\"/>", "not_seen", "not_found"),
        (
            '<CheckHeld object="cup" error_code="{code}" _onFailure="x := (code == \'time_limit\')"/>',
            "time_limit",
            "timeout",
        ),
        ('<AreErrorCodesPresent error_codes_to_check="lost;object_not_found"/>', "object_not_found", "not_found"),
        (CASES, "hand_full", "hand_not_empty"),
    ],
)
def test_a_tree_that_names_an_old_code_is_told_the_new_one(node: str, old: str, new: str) -> None:
    (problem,) = told(node)
    assert f"no skill fails with '{old}' (use '{new}')" in problem


@pytest.mark.parametrize(
    "body",
    [
        "<ScriptCondition code=\"code == 'not_found'\"/>",
        '<Log text="hand_full"/>',
        "<Sequence><Peek/><ScriptCondition code=\"code == 'not_seen'\"/></Sequence>",
    ],
)
def test_new_codes_other_texts_and_codes_of_own_skills_pass(body: str) -> None:
    assert told(body) == []


def test_a_suite_that_waits_for_an_old_code_is_told_the_new_one(tmp_path: Path) -> None:
    suite = tmp_path / "mine.yaml"
    suite.write_text(
        "tasks:\n  fetch_cup: {episodes: 1}\n"
        "controls:\n  blind: {task: fetch_cup, causes: [object_not_found], successes: {at_most: 0, of: 1}}\n"
    )
    with pytest.raises(ConfigurationError, match=r"mine.yaml:4: .*'object_not_found'; it is called 'not_found' now"):
        load_suite(str(suite))
