"""Wrong input is told once, on standard error, with exit code 2."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def input_errors() -> Iterator[None]:
    """Turn the errors that wrong input raises into a message and exit code 2."""
    try:
        yield
    except Exception as error:
        if not _is_wrong_input(error):
            raise
        print(f"bestman-bt: {_headline(error)}", file=sys.stderr)
        sys.exit(2)


def _is_wrong_input(error: Exception) -> bool:
    """Recognised by class name first: the packages that define them may not be imported at all."""
    names = {cls.__name__ for cls in type(error).__mro__}
    return bool(
        names
        & {
            *("ConfigurationError", "TreeLoadError", "SceneError", "MapFileError", "UnknownNameError", "RegistryError"),
            *("ConnectionFailedError", "GoalError", "DeclarationError", "MissingExtraError"),
        }
    )


def _headline(error: Exception) -> str:
    text = str(error)
    problems = getattr(error, "problems", None)
    count = text.count("\n") + 1 if problems is None else len(problems)
    return f"{count} errors, nothing was started:\n{text}" if count > 1 else f"nothing was started: {text}"
