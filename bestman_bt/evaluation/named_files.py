"""The files of a user that a run's configuration names, and those that they name in turn."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from bestman_bt.configuration import ConfigurationError, read_document, user_folders

_DOCUMENTS, _TREES = (".yaml", ".yml"), (".xml", ".urdf", ".xacro")


def named_files(values: Any, folder: Path = Path()) -> list[Path]:
    """Every file that texts in nested ``values`` name, from ``folder`` or as an addition of the user; in turn, too.

    ``file.py:Class`` names its file. YAML files, trees and URDF are read for what they name, Python files for this and
    for the modules beside them that they import. Sorted.
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
    """What a file may name others by; of an .onnx file its description, of anything unreadable nothing."""
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
    """Texts, and imported modules as the files that they are where they lie beside the one that imports them."""
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
