"""What a calibration found is laid over a robot's parts: where they are mounted, and the lens of a camera."""

from __future__ import annotations

from pathlib import Path

from bestman_bt.configuration import ConfigurationError, Document, Problem, read_document
from bestman_bt.registry import suggestion


def with_calibration(document: Document, folder: Path) -> Document:
    """A robot's document with the ``parts`` of its ``calibration`` files laid over its own, one file after the other.

    ``folder``: where relative names begin. Raises ConfigurationError for files that cannot be read or that are of
    another robot.
    """
    names = document.data.get("calibration", [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        message = f"should be a list of files that bestman-bt calibrate wrote, got {names!r}"
        raise ConfigurationError([document.problem(("calibration",), message)])
    problems: list[Problem] = []
    for index, name in enumerate(names):
        path = folder / name
        if not path.is_file():
            problems.append(document.problem(("calibration", index), f"no such calibration file: {path}"))
            continue
        found = read_document(path)
        parts, known = found.data.get("parts"), document.data.get("parts") or {}
        if not isinstance(parts, dict):
            problems.append(found.problem(("parts",), "is missing: this is no file that bestman-bt calibrate wrote"))
            continue
        problems += [
            found.problem(
                ("parts", part), f"the robot has no such part; {suggestion(str(part), [str(k) for k in known])}"
            )
            for part in parts
            if part not in known
        ]
        origins = {path: origin for path, origin in found.origins.items() if path[:1] == ("parts",)}
        document = document.merged(Document({"parts": parts}, origins))
    if problems:
        raise ConfigurationError(problems)
    return document
