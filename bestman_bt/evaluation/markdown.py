"""The document of an evaluation as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from bestman_bt.evaluation.suite import ALWAYS_ASKED
from bestman_bt.evaluation.summary import spread_words


def markdown(document: dict[str, Any]) -> str:
    """Return the document as Markdown: verdict, tables of tasks and controls, missed targets, failures."""
    return "\n".join(_lines(document)) + "\n"


def _lines(document: dict[str, Any]) -> Iterator[str]:
    yield f"# Evaluation: {document['evaluation']}"
    yield ""
    if document["description"]:
        yield document["description"]
        yield ""
    clean = "clean" if document["audit_clean"] else "NOT CLEAN"
    yield (
        f"**{verdict(document).capitalize()}.** {document['episodes']} episodes, "
        f"{document['false_successes']} false successes, {document['unearned']} unearned successes, "
        f"audit {clean}. Code {document['code']}" + (f", commit {document['commit']}." if document["commit"] else ".")
    )
    for note in document["notes"]:
        yield f"\n**Note:** {note}."
    for title, control in (("Tasks", False), ("Controls: expected to fail", True)):
        entries = [entry for entry in document["entries"] if entry["control"] is control]
        if entries:
            yield ""
            yield f"## {title}"
            yield ""
            yield from _table(entries)
    settings = {entry["name"]: entry["settings"] for entry in document["entries"] if entry["settings"]}
    if settings:
        yield ""
        yield "## Settings"
        yield ""
        for name, given in settings.items():
            yield f"- {name}: " + ", ".join(f"`{key}={value}`" for key, value in given.items())
    yield from _unearned(document["entries"])
    yield from _details(document["entries"])


def verdict(document: dict[str, Any]) -> str:
    """Return as text whether all targets were met; for tasks without a suite, whether all episodes succeeded."""
    if document["interrupted"]:
        return f"interrupted, {document['episodes']} of {_asked(document)} episodes completed"
    if any(entry["missing"] for entry in document["entries"]):
        return f"incomplete, {document['episodes']} of {_asked(document)} episodes completed"
    if not any(entry["targets"] for entry in document["entries"]):
        return "all episodes succeeded" if document["met"] else "not all episodes succeeded"
    if document["met"] and not any(own_targets(entry) for entry in document["entries"]):
        return "no targets"
    return "all targets met" if document["met"] else "not all targets met"


def _asked(document: dict[str, Any]) -> int:
    return sum(entry["asked_episodes"] for entry in document["entries"])


def own_targets(entry: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the explicit targets of an entry, without those that every entry has."""
    return [target for target in entry["targets"] if target["what"] not in ALWAYS_ASKED]


def _table(entries: list[dict[str, Any]]) -> Iterator[str]:
    yield "| | succeeded | 95 % interval | accuracy (median / p95) | false | audit | × real time | slowest | targets |"
    yield "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"
    for entry in entries:
        low, high = entry["interval"]
        cells = [
            entry["name"],
            f"{entry['succeeded']} of {entry['episodes']}",
            f"{low:.0%} to {high:.0%}",
            accuracy_words(entry["accuracy"]) or "–",
            str(entry["false_successes"]),
            "clean" if entry["audit_clean"] else "NOT CLEAN",
            f"{entry['real_time_factor']:.1f}",
            f"{entry['slowest']['sim_time_s']:.0f} s (seed {entry['slowest']['seed']})" if entry["slowest"] else "–",
            target_words(entry),
        ]
        yield table_row(cells)


def table_row(cells: Iterable[str]) -> str:
    """Return a row of a table; ``|`` in a cell is escaped."""
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


def accuracy_words(accuracy: dict[str, dict[str, Any]]) -> str:
    """Return text such as ``place_error_mm 3.1 / 7.9``; metrics of single objects are omitted if there are overall
    ones.
    """
    shown = [name for name in accuracy if not any(name.startswith(f"{other}_") for other in accuracy if other != name)]
    return ", ".join(f"{name} {spread_words(accuracy[name])}" for name in shown)


def target_words(entry: dict[str, Any]) -> str:
    """Return ``met``, or the missed targets; with the number of pending episodes."""
    if entry["episodes"] < entry["asked_episodes"]:
        return f"{entry['episodes']} of {entry['asked_episodes']} run"
    missed = [t for t in entry["targets"] if not t["met"]]
    if not missed:
        return "met" if own_targets(entry) else "none asked"
    return "missed: " + "; ".join(f"{t['what']} {t['found']}, asked {t['asked']}" for t in missed)


def _unearned(entries: list[dict[str, Any]]) -> Iterator[str]:
    lines = [f"- {entry['name']}, seed {one['seed']}: {one['why']}" for entry in entries for one in entry["unearned"]]
    if lines:
        yield from ("", "## Successes that are not the robot's", "", *lines)


def _details(entries: list[dict[str, Any]]) -> Iterator[str]:
    failed = [entry for entry in entries if entry["failures"] and not entry["control"]]
    if failed:
        yield ""
        yield "## What failed"
    for entry in failed:
        causes = ", ".join(f"{code} {count}" for code, count in entry["causes"].items())
        yield ""
        yield f"**{entry['name']}**: {causes}"
        yield ""
        for failure in entry["failures"]:
            where = f"`{failure['node']}`: " if failure["node"] else ""
            yield f"- seed {failure['seed']}: {where}{failure['why']} ({failure['error_code']})"
