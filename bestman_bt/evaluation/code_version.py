"""Fingerprints of the code and data of an episode, by content: commits and paths do not matter."""

from __future__ import annotations

import ast
import hashlib
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import yaml

from bestman_bt.configuration.data import data_root, user_folders
from bestman_bt.configuration.document import read_document
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import RunConfig, dump_run
from bestman_bt.evaluation.versions import versions

_DOCUMENTS, _TREES = (".yaml", ".yml"), (".xml", ".urdf", ".xacro")


def config_dependencies(values: Any, folder: Path = Path()) -> list[Path]:
    """Return every file that texts in nested ``values`` name, in ``folder`` or among the user's additions, recursively.

    ``file.py:Class`` names its file. YAML files, trees and URDF are searched for names, Python files also for imported
    modules beside them. Sorted.
    """
    found: set[Path] = set()
    _gather(values, folder, found)
    return sorted(found)


def _gather(values: Any, folder: Path, found: set[Path]) -> None:
    for text in _texts(values):
        for path in _meant(text, folder):
            if path not in found:
                found.add(path)
                _gather(_named_in(path), path.parent, found)


def _meant(text: str, folder: Path) -> Iterator[Path]:
    if not text or len(text) > 1000 or "\n" in text or "\0" in text:
        return
    file, is_class, _ = text.partition(".py:")
    candidates = [
        folder / (f"{file}.py" if is_class else text),
        *(added / f"{text}.yaml" for added in user_folders().values()),
    ]
    try:
        yield from (path.resolve() for path in candidates if path.is_file())
    except OSError:  # too long a name for this file system: no file
        return


def _named_in(path: Path) -> Any:
    """Return the files that a file may refer to; of an .onnx file its description, of an unreadable file none."""
    if path.suffix == ".onnx":
        return path.with_suffix(".json").name
    try:
        if path.suffix in _DOCUMENTS:
            return read_document(path).data
        if path.suffix in _TREES:
            return [list(element.attrib.values()) for element in ElementTree.parse(path).iter()]
        if path.suffix == ".py":
            return list(_named_in_python(ast.parse(path.read_bytes())))
    except (ConfigurationError, ElementTree.ParseError, SyntaxError, ValueError, OSError):
        return None
    return None


def _named_in_python(module: ast.Module) -> Iterator[str]:
    """Yield the texts of a module, and the imported modules that lie as files beside it."""
    for node in ast.walk(module):
        names: list[str] = []
        match node:
            case ast.Constant(value=str(text)):
                yield text
            case ast.Import():
                names = [alias.name for alias in node.names]
            case ast.ImportFrom():
                inside = [f"{node.module}.{alias.name}" if node.module else alias.name for alias in node.names]
                names = [*inside, *([node.module] if node.module else [])]
        for name in names:
            yield from (f"{name.replace('.', '/')}.py", f"{name.replace('.', '/')}/__init__.py")


def _texts(values: Any) -> Iterator[str]:
    if isinstance(values, str):
        yield values
    elif isinstance(values, Mapping):
        for value in values.values():
            yield from _texts(value)
    elif isinstance(values, (list, tuple)):
        for value in values:
            yield from _texts(value)


_PACKAGES = ("bestman_bt", "behaviours", "hal")
_DATA = ("assets", "configs", "trees")
_NO_MATTER = ("bestman_bt/cli/", "bestman_bt/_data/", "configs/evaluations/", "configs/tasks/")
"""Files that do not affect an episode; a task is part of the run's own configuration."""


def code_fingerprint() -> str:
    """Return a hash, 12 hexadecimal digits, of the sources, the shipped data and the versions of packages that affect a
    run."""
    digest = hashlib.sha256(yaml.safe_dump(versions()).encode())
    for name, path in sorted(_files()):
        digest.update(name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


def code_on_disk() -> frozenset[tuple[str, int, int]]:
    """Return name, inode and time of change, nanoseconds, of each file of ``code_fingerprint``; they differ once a file
    was replaced, even by an equal one."""
    about = ((name, path.stat()) for name, path in _files())
    return frozenset((name, each.st_ino, each.st_mtime_ns) for name, each in about)


def config_fingerprint(config: RunConfig) -> str:
    """Return twelve hexadecimal digits over a run's configuration, without seed and entry, and the user files it names.

    Includes files named by those files: furniture, objects, parts, meshes, included trees, policies.
    """
    task = config.task
    plain = replace(
        task,
        tree=Path(task.tree).name,
        scene=Path(task.scene).name,
        robot=Path(task.robot).name,
        plugins=tuple(Path(plugin).name for plugin in task.plugins),
    )
    config = replace(config, seed=0, entry="")
    digest = hashlib.sha256(dump_run(replace(config, task=plain)).encode())
    for path in config_dependencies(yaml.safe_load(dump_run(config))):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


def commit() -> str:
    """Return the commit of the checkout, with ``+changes`` if files differ from it; empty outside a checkout."""
    root = data_root()
    if not (root / ".git").exists():
        return ""
    try:
        head = _git(root, "rev-parse", "--short=12", "HEAD").strip()
        changed = _git(root, "status", "--porcelain", "--", *_PACKAGES, *_DATA)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return f"{head}+changes" if changed else head


def _git(root: Path, *arguments: str) -> str:
    return subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, check=True).stdout


def _files() -> Iterator[tuple[str, Path]]:
    packages = Path(__file__).resolve().parents[2]
    for root, folders, pattern in ((packages, _PACKAGES, "*.py"), (data_root(), _DATA, "*")):
        for folder in folders:
            for path in (root / folder).rglob(pattern):
                name = path.relative_to(root).as_posix()
                if path.is_file() and path.suffix != ".pyc" and not name.startswith(_NO_MATTER):
                    yield name, path
