"""The tables of docs/comparisons.md: scripts/comparisons.py measures each at the commit that it names."""

import json
import re
from dataclasses import replace

from scripts.comparisons import COMPARISONS, FOLDER, PAGE, with_table


def test_each_table_of_the_page_names_its_commit_which_is_that_of_the_data_that_are_kept() -> None:
    page = PAGE.read_text(encoding="utf-8")
    parts = dict(re.findall(r"<!-- scripts/comparisons\.py: (\w+) -->\n(.*?)<!-- end -->", page, re.DOTALL))
    assert parts.keys() == COMPARISONS.keys()
    kept = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in FOLDER.glob("*.json")}
    assert {"engine", "planning_domains"} <= kept.keys() <= {c for one in COMPARISONS.values() for c in one.commands}
    for name, text in parts.items():
        (commit,) = re.findall(r"^Commit ([0-9a-f]{8,})\.$", text, re.MULTILINE)
        for command in COMPARISONS[name].commands.keys() & kept.keys():
            assert kept[command]["commit"] == commit
            assert {"machine", "versions", "command"} <= kept[command].keys()


def test_a_new_table_replaces_the_old_one_between_its_marks() -> None:
    mark = "<!-- scripts/comparisons.py: engine -->"
    page = f"before\n\n{mark}\n\n| old |\n\nCommit 1.\n\n<!-- end -->\n\nafter\n"
    row = dict.fromkeys(("ours_us", "ours_logged_us", "peer"), 1.5) | {"visitor": None}
    new = with_table(page, "engine", COMPARISONS["engine"], {"engine": {"wide": row}}, "2f")
    assert "old" not in new
    assert "| wide | 1.5 | 1.5 | 1.5 | - |" in new
    assert "Commit 2f." in new
    assert new.startswith("before")
    assert new.endswith("<!-- end -->\n\nafter\n")
    assert with_table(new, "engine", COMPARISONS["engine"], {"engine": {"wide": row}}, "2f") == new


def test_every_table_of_the_page_can_be_replaced() -> None:
    """From an empty table, and from one that is there."""
    page = PAGE.read_text(encoding="utf-8")
    for name, comparison in COMPARISONS.items():
        shown = replace(comparison, rows=lambda found: [["cell"]])
        for _ in range(2):
            page = with_table(page, name, shown, {}, "0123abcd")
    assert page.count("| cell |") == len(COMPARISONS)
    assert all(f"<!-- scripts/comparisons.py: {name} -->" in page for name in COMPARISONS)
    assert page.count("\n## ") == PAGE.read_text(encoding="utf-8").count("\n## ")
