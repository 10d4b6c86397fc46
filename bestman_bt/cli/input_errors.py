"""Invalid input is reported once, on standard error, with exit code 2."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from bestman_bt.errors import InputError


@contextmanager
def input_errors(starts: bool) -> Iterator[None]:
    """Turn the errors that wrong input raises into a message and exit code 2.

    ``starts``: whether the verb would have started something, which the message then denies.
    """
    try:
        yield
    except InputError as error:
        print(f"bestman-bt: {_message(error, starts)}", file=sys.stderr)
        sys.exit(2)


def _message(error: InputError, starts: bool) -> str:
    count = len(getattr(error, "problems", (error,)))
    nothing = "nothing was started" if starts else ""
    if count > 1:
        return f"{count} errors{', ' if nothing else ''}{nothing}:\n{error}"
    return f"{nothing}: {error}" if nothing else str(error)
