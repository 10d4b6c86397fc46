"""Writes the table of facts in docs/task_planning.md from the predicates themselves.

.venv/bin/python scripts/fact_table.py
"""

from __future__ import annotations

import re
from pathlib import Path

from bestman_bt.facts.predicate import Predicate, shipped_predicates

PAGE = Path(__file__).parents[1] / "docs" / "task_planning.md"
_TABLE = re.compile(r"(?<=<!-- scripts/fact_table.py -->\n\n).*?(?=\n\n)", re.DOTALL)


def page() -> str:
    """The page with the table as it should be."""
    head = "| fact | the robot believes that | judged by the true state |\n| --- | --- | --- |"
    rows = [_row(predicate) for _, predicate in sorted(shipped_predicates().items())]
    return _TABLE.sub(lambda _: "\n".join([head, *rows]), PAGE.read_text(encoding="utf-8"))


def _row(predicate: Predicate) -> str:
    arguments = ", ".join(predicate.parameters)
    fact = f"{predicate.name}({arguments})" if arguments else predicate.name
    judged = "yes" if predicate.why_not or predicate.means else "no"
    return f"| `{fact}` | {re.sub(r'[{}]', '', predicate.words)} | {judged} |"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
