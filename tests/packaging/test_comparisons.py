"""The tables of docs/comparisons.md: scripts/comparisons.py measures each at the commit that it names."""

from dataclasses import replace

from scripts.comparisons import COMPARISONS, PAGE, with_table


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
