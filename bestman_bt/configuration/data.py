"""Where shipped data lies: assets, configurations and trees, by kind and name."""

from __future__ import annotations

from pathlib import Path

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.registry import suggestion

_FOLDERS = {
    "robot": ("configs/robots", (".yaml",)),
    "task": ("configs/tasks", (".yaml",)),
    "algorithms": ("configs/algorithms", (".yaml",)),
    "part": ("assets/robots", (".yaml",)),
    "scene": ("assets/scenes", (".yaml",)),
    "furniture": ("assets/furniture", (".yaml",)),
    "object": ("assets/objects", (".yaml",)),
    "tree": ("trees", (".xml", ".py")),
}


def data_root() -> Path:
    """The folder that holds ``assets``, ``configs`` and ``trees``: the checkout's, else the installed package's."""
    package = Path(__file__).resolve().parents[1]
    checkout = package.parent
    if (checkout / "pyproject.toml").is_file() and (checkout / "assets").is_dir():
        return checkout
    return package / "_data"


def data_names(kind: str) -> list[str]:
    """Sorted names of the shipped files of a ``kind`` (robot, task, algorithms, part, scene, furniture, …)."""
    folder, suffixes = _FOLDERS[kind]
    return sorted({path.stem for path in (data_root() / folder).glob("*") if path.suffix in suffixes})


def find_data(kind: str, name: str | Path, asked_by: Problem | None = None) -> Path:
    """The file of ``name``: a bare name means a shipped one, a path (with a folder or a suffix) means that file.

    ``asked_by``: the place that names it, for the error's source, line and field (its message is not used).
    Raises ConfigurationError that suggests the closest shipped name.
    """
    folder, suffixes = _FOLDERS[kind]
    text = str(name)
    if isinstance(name, Path) or "/" in text or "\\" in text or Path(text).suffix in suffixes:
        path = Path(name)
        if path.is_file():
            return path
        message = f"no such {kind} file: {text}"
    else:
        for suffix in suffixes:
            path = data_root() / folder / f"{text}{suffix}"
            if text and path.is_file():
                return path
        message = f"unknown {kind} {text!r}; {suggestion(text, data_names(kind))}"
    place = asked_by or Problem(text, None, "", "")
    raise ConfigurationError([Problem(place.source, place.line, place.field, message)])
