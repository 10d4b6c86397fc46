"""Precomputed grasps, in a JSON file beside the object's."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bestman_bt.configuration.checked import check
from bestman_bt.configuration.document import Document
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.quantity import Lengths3, Number, PositiveLength, Share
from bestman_bt.messages import ObjectGrasp, Pose


@dataclass(frozen=True)
class GraspEntry:
    """An ObjectGrasp: ``xyz`` metres and ``quaternion`` (x, y, z, w) of object_from_tool."""

    xyz: Lengths3
    quaternion: tuple[Number, Number, Number, Number]
    width: PositiveLength
    quality: Share


@dataclass(frozen=True)
class GraspsFile:
    """``gripper``: the one that they are for, in words. ``grasps``: in the object's frame, best first."""

    gripper: str
    grasps: tuple[GraspEntry, ...]


def read_grasps(path: Path, asked_by: Problem) -> tuple[ObjectGrasp, ...]:
    """Return the grasps of a file. Raises ConfigurationError, at ``asked_by`` if it is missing or not JSON."""
    try:
        document = Document(json.loads(path.read_text(encoding="utf-8")), {(): (str(path), None)})
        return tuple(
            ObjectGrasp(Pose(np.array(grasp.xyz), np.array(grasp.quaternion)), grasp.width, grasp.quality)
            for grasp in check(document, GraspsFile).grasps
        )
    except ConfigurationError:
        raise
    except (OSError, ValueError) as error:
        message = f"cannot use the grasps of {path.name}: {error}"
        raise ConfigurationError([Problem(asked_by.source, asked_by.line, asked_by.field, message)]) from error


def grasps_json(gripper: str, grasps: Sequence[ObjectGrasp]) -> str:
    """Return the text for ``read_grasps``, with a line per grasp."""
    lines = [
        json.dumps(
            {
                "xyz": [round(float(v), 6) for v in grasp.object_from_tool.position],
                "quaternion": [round(float(v), 7) for v in grasp.object_from_tool.quaternion],
                "width": round(grasp.width, 6),
                "quality": round(grasp.quality, 4),
            }
        )
        for grasp in grasps
    ]
    body = ",\n    ".join(lines)
    return f'{{\n  "gripper": {json.dumps(gripper)},\n  "grasps": [\n    {body}\n  ]\n}}\n'
