"""Words that must not come back into docstrings, messages and pages: ``python scripts/plain_english.py``, exit code 1.

Plain technical English names the component, not "somebody"; a parameter is "given" or "passed", not "told". ``REFUSED``
must not occur at all. ``LEFT`` counts phrases that are still in the code: their number may fall, never rise; lower the
limit when one is removed.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

Text = tuple[str, int, str]
"""File, first line and text."""
CHECKOUT = Path(__file__).resolve().parents[1]
CODE = ("bestman_bt", "hal", "behaviours")
REFUSED = {
    "somebody": '"a person", "the user" or the component',
    "nobody": '"no person" or "no" with the component',
    "whoever": '"the caller" or "the user"',
    "anybody": '"any caller"',
    "everybody": '"every" with the noun',
    "anyhow": '"in any case" or nothing',
    "as the crow flies": '"straight-line distance"',
    "for want of": '"without"',
    "lest": '"so that … not"',
    "ought to": '"should"',
    "hitherto": '"so far"',
    "wherein": '"in which"',
    "thereof": '"of it"',
    "thereby": '"by this"',
    "well-nigh": '"almost"',
    "who is in the way": '"the obstacle"',
    "does not get on": '"makes no progress"',
    "what came of": '"the result"',
    "came to nothing": '"failed"',
    "counts no more": '"is no longer valid"',
    "how all stands": '"the current state"',
    "how things stand": '"the current state"',
    "how it stands": '"the current state"',
    "as they stand": '"as they are"',
    "as it stands": '"as it is"',
    "that of which": "the noun",
    "goes about": "the verb",
    "gone about": "the verb",
    "looked for anew": '"searched again"',
    "who asked for": '"the caller of"',
    "as of old": '"as before"',
    "again and again": '"repeatedly"',
    "is owed": '"is expected"',
    "it is looked": '"it is checked"',
    "for good": '"permanently"',
    "now and then": '"sometimes"',
    "mend": '"repair" or "fix"',
    "to be had": '"available"',
    "so called": '"of this name"',
    "has told": '"has reported"',
    "begun again": '"restarted"',
    "takes in": '"processes"',
    "mends": '"repairs" or "fixes"',
}
"""Phrase → what to write instead, in docstrings, messages and pages."""
LEFT = {
    "anew": (0, 0),
    "is to be": (0, 0),
    "are to be": (0, 0),
    "as it was": (0, 0),
    "told": (0, 0),
    "tells": (0, 0),
    "tell": (1, 0),
    "is none": (52, 2),
    "are none": (7, 2),
    "in words": (0, 0),
    "shall": (1, 0),
    "goes on": (1, 1),
    "go on": (0, 1),
    "is asked for": (0, 0),
    "let go": (1, 0),
    "what is": (8, 21),
    "is no": (81, 14),
    "by itself": (2, 3),
    "of its own": (7, 3),
    "in the way": (2, 1),
}
"""Phrase → the most occurrences in docstrings and messages, and in pages."""
QUOTED = re.compile(r"```.*?```|`[^`\n]*`|\]\([^)\n]*\)|<!--.*?-->", re.DOTALL)
"""Code and links of a page, which keep their names."""
OWN_WORDS = ("docs/decisions.md", "docs/migration.md")
"""Pages that quote old names."""


def texts_of(source: str) -> Iterator[tuple[int, str]]:
    """Yield line and text of each docstring and each other string of a module; parts of f-strings separately."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield node.lineno, node.value


def pages() -> list[Path]:
    """Return the pages of the documentation and of the root folder, without those that quote old names."""
    found = [*sorted((CHECKOUT / "docs").rglob("*.md")), CHECKOUT / "README.md", CHECKOUT / "CONTRIBUTING.md"]
    return [path for path in found if str(path.relative_to(CHECKOUT)) not in OWN_WORDS]


def pattern(phrases: Iterable[str]) -> re.Pattern[str]:
    """Return the expression that finds phrases as whole words, also across line ends, in either case."""
    longest_first = sorted(phrases, key=len, reverse=True)
    return re.compile(
        r"\b(?:" + "|".join(r"\s+".join(map(re.escape, phrase.split())) for phrase in longest_first) + r")\b",
        re.IGNORECASE,
    )


def occurrences(phrases: Iterable[str], texts: Iterable[Text]) -> Iterator[tuple[str, str, int]]:
    """Yield phrase, file and line of each occurrence."""
    expression = pattern(phrases)
    for file, line, text in texts:
        for match in expression.finditer(text):
            yield " ".join(match.group().lower().split()), file, line + text.count("\n", 0, match.start())


def code_texts() -> list[Text]:
    """Return file, line and text of all docstrings and messages."""
    files = sorted(path for folder in CODE for path in (CHECKOUT / folder).rglob("*.py"))
    return [
        (str(path.relative_to(CHECKOUT)), line, text)
        for path in files
        for line, text in texts_of(path.read_text(encoding="utf-8"))
    ]


def page_texts() -> list[Text]:
    """Return file, first line and prose of all pages; code and links are blanked."""
    return [
        (
            str(path.relative_to(CHECKOUT)),
            1,
            QUOTED.sub(lambda match: "\n" * match.group().count("\n"), path.read_text(encoding="utf-8")),
        )
        for path in pages()
    ]


def faults(code: Sequence[Text], prose: Sequence[Text]) -> list[str]:
    """Return one line per refused phrase, and one per phrase that occurs more often than ``LEFT`` allows."""
    found = [
        f"{file}:{line}: {phrase!r}: write {REFUSED[phrase]}"
        for phrase, file, line in occurrences(REFUSED, [*code, *prose])
    ]
    for texts, place, where in ((code, 0, "docstrings and messages"), (prose, 1, "pages")):
        met: dict[str, list[str]] = {}
        for phrase, file, line in occurrences(LEFT, texts):
            met.setdefault(phrase, []).append(f"{file}:{line}")
        for phrase, places in met.items():
            if len(places) > LEFT[phrase][place]:
                limit, shown = LEFT[phrase][place], ", ".join(places[-5:])
                found.append(f"{phrase!r}: {len(places)} times in {where}, at most {limit}: … {shown}")
    return found


def main() -> int:
    """Print the faults; returns the exit code."""
    found = faults(code_texts(), page_texts())
    print("\n".join(found) if found else "plain English: no refused words")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
