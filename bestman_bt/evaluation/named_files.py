"""The files of a user that a run's configuration names, and those that they name in turn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from bestman_bt.configuration import ConfigurationError, read_document, user_folders

_DOCUMENTS, _TREES = (".yaml", ".yml"), (".xml", ".urdf", ".xacro")


def named_files(values: Any, folder: Path = Path()) -> list[Path]:
    """Every file that texts in nested ``values`` name, from ``folder`` or as an addition of the user; in turn, too.

    YAML files, trees and URDF are read for what they name. Sorted.
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
    candidates = [folder / text, *(added / f"{text}.yaml" for added in user_folders().values())]
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
    except (ConfigurationError, ElementTree.ParseError, OSError):
        return None
    return None


def _texts(values: Any) -> Iterator[str]:
    if isinstance(values, str):
        yield values
    elif isinstance(values, Mapping):
        for value in values.values():
            yield from _texts(value)
    elif isinstance(values, (list, tuple)):
        for value in values:
            yield from _texts(value)
