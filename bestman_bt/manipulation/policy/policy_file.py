"""Policies from files: a network (.onnx with its .json) or the description of a server (.yaml)."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import yaml

from bestman_bt.manipulation.policy.base import Policy
from bestman_bt.manipulation.policy.errors import PolicyModelError
from bestman_bt.manipulation.policy.onnx_policy import OnnxPolicy
from bestman_bt.manipulation.policy.openpi_client import OpenpiPolicy


def load_policy(path: str | Path) -> Policy:
    """Return the policy of a file. A .yaml has the fields of OpenpiPolicy. Raises PolicyModelError if it is invalid."""
    path = Path(path)
    if path.suffix == ".onnx":
        return OnnxPolicy(str(path))
    if path.suffix != ".yaml":
        raise PolicyModelError(f"a policy is an .onnx or a .yaml file, not {str(path)!r}")
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise PolicyModelError(f"{path} does not describe a policy server: {error}") from error
    return _server(path, values)


def _server(path: Path, values: Any) -> OpenpiPolicy:
    known = {field.name for field in fields(OpenpiPolicy) if field.init}
    if not isinstance(values, dict) or not values.get("url") or set(values) - known:
        wrong = sorted(set(values) - known) if isinstance(values, dict) else "no fields"
        raise PolicyModelError(f"{path} should have 'url' and other fields of a policy server; it has {wrong}")
    try:
        for name in ("joint_names", "image_size"):
            if name in values:
                if not isinstance(values[name], list):
                    raise TypeError(f"{name} should be a list, got {values[name]!r}")
                values[name] = tuple(values[name])
        return OpenpiPolicy(**values)
    except (TypeError, PolicyModelError) as error:
        raise PolicyModelError(f"{path} does not describe a policy server: {error}") from error
