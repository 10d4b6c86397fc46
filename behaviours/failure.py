"""What a leaf tells of its failure."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Failure:
    """Why a leaf failed: ``node`` is its path in the tree, ``stamp`` seconds on the robot's clock.

    ``where``: its name with file and line, for people.
    """

    node: str
    error_code: str
    why: str
    stamp: float
    where: str = ""
