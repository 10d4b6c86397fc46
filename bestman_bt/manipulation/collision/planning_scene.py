"""The planning scene: everything around an arm, in the robot's base frame, as plain values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import PlacedShape, Pose


@dataclass(frozen=True)
class SceneObstacle:
    """A fixed body: ``shapes`` in the base frame; ``padding``: metres, in addition to the scene's."""

    name: str
    shapes: tuple[PlacedShape, ...]
    padding: float = 0.0


@dataclass(frozen=True, eq=False)
class VoxelObstacle:
    """Filled cubes of a grid: ``indices`` (N, 3) of voxels, ``base_from_grid``: the outer corner of voxel (0, 0, 0).

    ``resolution``: a voxel's edge; ``padding``: added to the scene's; metres.
    """

    name: str
    base_from_grid: Pose
    indices: NDArray[np.int64]
    resolution: float
    padding: float = 0.0


@dataclass(frozen=True)
class AttachedObject:
    """An object in the hand: ``shapes`` in its own frame; ``touch_links``: links that may touch it."""

    name: str
    shapes: tuple[PlacedShape, ...]
    tool_frame: str
    tool_from_object: Pose
    touch_links: frozenset[str]
    padding: float = 0.0


@dataclass(frozen=True)
class PlanningScene:
    """Obstacles, and the state of all fixed joints.

    ``attached``: the object held by the moving arm; ``carried``: objects held by other arms, fixed. ``positions``:
    joint name → radians or metres; missing joints are at zero; those of the moving arm are ignored. ``allowed_pairs``:
    names of links, obstacles or the attached object that may touch. ``padding``: metres between the arm (or its object)
    and obstacles; ``self_padding``: between links. ``other_arm_padding``: metres between an arm, with its held object,
    and other arms: both differ from their set-points, and an object from its pose in the hand. With several arms a held
    object keeps this distance from all links that its arm does not move, such as torso, mast and base. ``voxels``: seen
    space that no known body explains; the current volume of the robot and its object is excluded.
    """

    positions: Mapping[str, float]
    obstacles: tuple[SceneObstacle, ...] = ()
    attached: AttachedObject | None = None
    carried: tuple[AttachedObject, ...] = ()
    allowed_pairs: frozenset[frozenset[str]] = frozenset()
    padding: float = 0.002
    self_padding: float = 0.002
    other_arm_padding: float = 0.01
    voxels: tuple[VoxelObstacle, ...] = ()

    def allowing(self, *pairs: tuple[str, str]) -> PlanningScene:
        """Return the scene with these additional pairs of names that may touch."""
        return replace(self, allowed_pairs=self.allowed_pairs | {frozenset(pair) for pair in pairs})

    def adding(self, *obstacles: SceneObstacle) -> PlanningScene:
        """Return the scene with these obstacles; one of the same name is replaced."""
        names = {obstacle.name for obstacle in obstacles}
        return replace(self, obstacles=tuple(o for o in self.obstacles if o.name not in names) + obstacles)

    def without(self, *names: str) -> PlanningScene:
        """Return the scene without the obstacles of these names."""
        return replace(
            self,
            obstacles=tuple(o for o in self.obstacles if o.name not in names),
            voxels=tuple(v for v in self.voxels if v.name not in names),
        )

    def holding(self, attached: AttachedObject | None) -> PlanningScene:
        """Return the scene with this object (or none) in the hand; an obstacle of its name disappears."""
        scene = self if attached is None else self.without(attached.name)
        return replace(scene, attached=attached)
