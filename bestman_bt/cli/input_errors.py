"""Wrong input is told once, on standard error, with exit code 2."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from bestman_bt.errors import InputError


@contextmanager
def input_errors() -> Iterator[None]:
    """Turn the errors that wrong input raises into a message and exit code 2."""
    try:
        yield
    except InputError as error:
        print(f"bestman-bt: {_headline(error)}", file=sys.stderr)
        sys.exit(2)


def _headline(error: InputError) -> str:
    text = str(error)
    problems = getattr(error, "problems", None)
    count = 1 if problems is None else len(problems)
    return f"{count} errors, nothing was started:\n{text}" if count > 1 else f"nothing was started: {text}"
