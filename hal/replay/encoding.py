"""Values of the Robotics API as JSON, and back to the same bits."""

from __future__ import annotations

import base64
import dataclasses
import zlib
from enum import Enum
from typing import Any

import numpy as np

import bestman_bt.messages
import hal.api
from hal.api import PartError, RobotError

_MODULES = (bestman_bt.messages, hal.api)
_TYPES: dict[str, type] = {
    name: found for module in _MODULES for name, found in vars(module).items() if isinstance(found, type)
}


def to_json(value: Any) -> Any:
    """Dataclasses of ``bestman_bt.messages`` and ``hal.api``, arrays, enumerations, tuples and plain values."""
    if isinstance(value, np.ndarray):
        packed = base64.b64encode(zlib.compress(np.ascontiguousarray(value).tobytes(), 1)).decode("ascii")
        return {"array": packed, "dtype": str(value.dtype), "shape": list(value.shape)}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Enum):
        return {"enum": type(value).__name__, "value": value.value}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {field.name: to_json(getattr(value, field.name)) for field in dataclasses.fields(value) if field.init}
        return {"type": type(value).__name__, "fields": fields}
    if isinstance(value, (tuple, list)):
        return {"items": [to_json(item) for item in value], "list": isinstance(value, list)}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise TypeError(f"a {type(value).__name__} cannot be recorded")


def from_json(document: Any) -> Any:
    """What ``to_json`` was given; LookupError for a type that is not known."""
    if not isinstance(document, dict):
        return document
    if "array" in document:
        data = zlib.decompress(base64.b64decode(document["array"]))
        return np.frombuffer(data, document["dtype"]).reshape(document["shape"])
    if "enum" in document:
        return _TYPES[document["enum"]](document["value"])
    if "type" in document:
        fields = {name: from_json(value) for name, value in document["fields"].items()}
        return _TYPES[document["type"]](**fields)
    items = [from_json(item) for item in document["items"]]
    return items if document["list"] else tuple(items)


def error_to_json(error: RobotError) -> dict[str, str]:
    """Its class, its words and the vendor's code; the line that it is written to names the part."""
    code = error.failure.vendor_code if isinstance(error, PartError) else ""
    return {"error": type(error).__name__, "words": str(error), **({"vendor_code": code} if code else {})}


def error_from_json(document: dict[str, str]) -> RobotError:
    """The error again."""
    kind = _TYPES.get(document["error"], RobotError)
    if issubclass(kind, PartError):
        return kind(document["words"], document.get("part", ""), document.get("vendor_code", ""))
    return kind(document["words"]) if issubclass(kind, RobotError) else RobotError(document["words"])
