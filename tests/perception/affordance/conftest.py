from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from benchmarks.perception_measures.distractors import Parts, block
from benchmarks.rendering import render_view
from bestman_bt.messages import Handle, Pose
from bestman_bt.perception.view import View
from bestman_bt.scene.furniture_generator.generate import generate_furniture
from bestman_bt.scene.scene import FurnitureModel

FrontView = Callable[..., tuple[View, tuple[Handle, ...]]]


def shapes_of(model: FurnitureModel, handles: bool = True) -> Parts:
    """Coloured shapes; without ``handles``, each door or drawer is its largest shape alone."""
    parts: Parts = [(part, color[:3]) for part, color in zip(model.parts, model.colors, strict=True)]
    for articulation in model.articulations:
        pieces = [(p, c[:3]) for p, c in zip(articulation.parts, articulation.colors, strict=True)]
        parts += pieces if handles else pieces[:1]
    return parts


def camera_before(target: np.ndarray, distance: float, aside: float, down: float) -> Pose:
    """A camera that looks at ``target`` of furniture whose front faces -x; angles in degrees."""
    azimuth, pitch = math.radians(aside), math.radians(down)
    away = np.array([-math.cos(pitch) * math.cos(azimuth), math.cos(pitch) * math.sin(azimuth), math.sin(pitch)])
    right = np.cross(-away, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(-away, right), -away], axis=1)
    matrix[:3, 3] = target + distance * away
    return Pose.from_matrix(matrix)


@pytest.fixture
def camera() -> Callable[[np.ndarray, float, float, float], Pose]:
    """Poses of cameras, see camera_before."""
    return camera_before


@pytest.fixture(scope="session")
def front_view() -> FrontView:
    """A view of generated furniture, aimed at the middle of its handles, and its true handles; drawn once each."""
    drawn: dict[str, tuple[View, tuple[Handle, ...]]] = {}

    def draw(
        kind: str,
        seed: int = 1,
        distance: float = 1.2,
        aside: float = 20.0,
        down: float = 15.0,
        handles: bool = True,
        extra: Parts | None = None,
        **options: Any,
    ) -> tuple[View, tuple[Handle, ...]]:
        key = repr((kind, seed, distance, aside, down, handles, extra, options))
        if key not in drawn:
            rng = np.random.default_rng(seed)
            model = generate_furniture(kind, rng, **options)
            true = tuple(articulation.handle for articulation in model.articulations)
            target = np.mean([handle.pose.position for handle in true], axis=0)
            room = block((-4.0, -4.0, -0.02), (4.0, 4.0, 0.0), (0.5, 0.5, 0.45))
            room += block((0.5, -3.0, 0.0), (0.6, 3.0, 2.6), (0.8, 0.75, 0.7))
            parts = shapes_of(model, handles) + room + (extra or [])
            drawn[key] = (render_view(parts, camera_before(target, distance, aside, down), rng), true)
        return drawn[key]

    return draw
