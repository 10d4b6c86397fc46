"""The location of shipped data: assets, configurations and trees, by kind and name."""

from __future__ import annotations

import os
from collections.abc import Iterable
from difflib import get_close_matches
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from bestman_bt.configuration.errors import ConfigurationError, Problem, ProblemCollector
from bestman_bt.extras import PYBULLET_HAS_WHEELS, install_command
from bestman_bt.registry import suggestion

_FOLDERS = {
    "robot": ("configs/robots", (".yaml",)),
    "task": ("configs/tasks", (".yaml",)),
    "evaluation": ("configs/evaluations", (".yaml",)),
    "algorithms": ("configs/algorithms", (".yaml",)),
    "part": ("assets/robots", (".yaml",)),
    "scene": ("assets/scenes", (".yaml",)),
    "furniture": ("assets/furniture", (".yaml",)),
    "object": ("assets/objects", (".yaml",)),
    "policy": ("assets/policies", (".onnx", ".yaml")),
    "tree": ("trees", (".xml", ".py")),
}

_OF_USERS = ("object", "part", "robot")


@cache
def data_root() -> Path:
    """Return the folder that holds ``assets``, ``configs`` and ``trees``: the checkout's, else the installed
    package's.
    """
    package = Path(__file__).resolve().parents[1]
    checkout = package.parent
    if (checkout / "pyproject.toml").is_file() and (checkout / "assets").is_dir():
        return checkout
    return package / "_data"


def shipped_trees() -> tuple[Path, ...]:
    """Return the folders from which any tree may include: that of the shipped trees."""
    return (data_root() / _FOLDERS["tree"][0],)


def own_objects() -> Path:
    """Return the folder of the user's objects: the checkout's, else ``$XDG_DATA_HOME/bestman-bt/objects``."""
    if (data_root() / "pyproject.toml").is_file():
        return data_root() / _FOLDERS["object"][0]
    return _user_folder("object")


def own_parts() -> Path:
    """Return the folder of the user's parts: the checkout's, else ``$XDG_DATA_HOME/bestman-bt/parts``."""
    if (data_root() / "pyproject.toml").is_file():
        return data_root() / _FOLDERS["part"][0]
    return _user_folder("part")


def pybullet_data() -> Path | None:
    """Return the folder of PyBullet's models, from its wheel or from ``bestman-bt robot descriptions``; None if
    missing.
    """
    installed = find_spec("pybullet_data")
    if installed is not None and installed.submodule_search_locations:
        return Path(installed.submodule_search_locations[0])
    unpacked = own_pybullet_data()
    return unpacked if unpacked.is_dir() else None


def no_pybullet_data() -> str:
    """Return the remedy for missing PyBullet models."""
    with_it = f", {install_command('sim')} with it" if PYBULLET_HAS_WHEELS else ""
    return (
        "is in pybullet_data, which is not here: `bestman-bt robot descriptions` downloads it without the simulator"
        + with_it
    )


def own_pybullet_data() -> Path:
    """Return the folder of PyBullet's models without PyBullet: ``$XDG_DATA_HOME/bestman-bt/pybullet_data``."""
    return _user_data() / "pybullet_data"


def data_names(kind: str) -> list[str]:
    """Return the sorted names of the files of a ``kind`` (robot, task, algorithms, part, scene, furniture, object,
    …)."""
    suffixes = _FOLDERS[kind][1]
    return sorted({path.stem for folder in _folders(kind) for path in folder.glob("*") if path.suffix in suffixes})


def find_data(kind: str, name: str | Path, asked_by: Problem | None = None) -> Path:
    """Return the file of ``name``: a path (with a folder or a suffix), or the name of a shipped file.

    For an object, a part or a robot, a bare name also finds the user's own. ``asked_by``: the place of the name, for
    the error's source, line and field (its message is not used). Raises ConfigurationError that suggests the closest
    name.
    """
    suffixes = _FOLDERS[kind][1]
    text = str(name)
    place, wrong = asked_by or Problem(text, None, "", ""), ProblemCollector()
    if isinstance(name, Path) or _is_path(kind, text):
        path = Path(name)
        if path.is_file():
            return path
        message = f"no such {kind} file{'' if place.source == text else f': {text}'}{_alike(kind, path)}"
    else:
        for path in (folder / f"{text}{suffix}" for folder in _folders(kind) for suffix in suffixes):
            if text and path.is_file():
                return path
        own = next((own for suffix in suffixes if text and (own := Path(text + suffix)).is_file()), None)
        hint = suggestion(text, data_names(kind)) if own is None else f"did you mean your file '{own}'?"
        message = f"unknown {kind} {text!r}; {hint}"
        if kind == "robot" and "+" in text:
            message = (
                f"{text!r} is a combination of parts, which has no cameras, lidar and postures yet: write a robot file "
                "(docs/add_your_robot.md), 'bestman-bt robot postures FILE' proposes postures for it"
            )
            for part in text.split("+"):
                with wrong.step():
                    find_data("part", part, place)
    wrong.problems.append(Problem(place.source, place.line, place.field, message))
    raise ConfigurationError(wrong.problems)


def _alike(kind: str, path: Path) -> str:
    """Return words that suggest the most similar file in the folder of a missing one, or the most
    similar shipped name.
    """
    files = {found.stem: found.name for found in path.parent.glob("*") if found.suffix in _FOLDERS[kind][1]}
    close = [str(path.with_name(files[name])) for name in get_close_matches(path.stem, files, n=1)]
    close += get_close_matches(path.stem, data_names(kind), n=1)
    return f"; did you mean {close[0]!r}?" if close else ""


def beside(file: Path, kind: str, name: str) -> str:
    """Resolve ``name`` in ``file``: a path is relative to the file's folder, a bare name is kept."""
    return str(file.parent / name) if _is_path(kind, name) else name


def in_folders(name: str, folders: Iterable[Path]) -> str:
    """Return the path of a file in the first of ``folders`` that has it, else ``name``; a name without suffix is
    kept.
    """
    if not Path(name).suffix:
        return name
    return next((str(found) for folder in folders if (found := folder / name).is_file()), name)


def user_folders() -> dict[str, Path]:
    """Return the folders of the user's own data by kind."""
    return {kind: _user_folder(kind) for kind in _OF_USERS}


def _is_path(kind: str, text: str) -> bool:
    return "/" in text or "\\" in text or Path(text).suffix in _FOLDERS[kind][1]


def _folders(kind: str) -> list[Path]:
    shipped = data_root() / _FOLDERS[kind][0]
    return [shipped, _user_folder(kind)] if kind in _OF_USERS else [shipped]


def _user_folder(kind: str) -> Path:
    return _user_data() / f"{kind}s"


def _user_data() -> Path:
    return Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local/share") / "bestman-bt"
