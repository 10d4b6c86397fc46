"""What the robot believes: where it is, which objects and handles it has seen, what it holds."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Handle, ObjectModel, PlacedShape, PointCloud, Pose, Pose2D, VoxelGrid, YawSet
from bestman_bt.world_model.semantic_map import SemanticMap


@dataclass(frozen=True, eq=False)
class ObjectBelief:
    """An object as last seen: ``pose`` in the map frame, ``confidence`` 0 to 1, ``stamp`` seconds.

    ``name``: its identity: the model's name, with a number where several are known (``can_2``); ``thing_1`` for what no
    model explains. ``position_std``: metres. ``surface``: the name of the surface that it stands on, if any.
    ``yaw_set``: the yaws that it may have. ``since``: seconds, when it came to stand there, as far as was seen.
    ``recognised``: False for a thing whose model is no more than its measured box; ``cloud``: its points in the map
    frame, and ``viewpoint``: (3,) from where they were measured.
    """

    name: str
    model: ObjectModel
    pose: Pose
    confidence: float
    position_std: float
    stamp: float
    surface: str | None = None
    yaw_set: YawSet = field(default_factory=YawSet)
    since: float | None = None
    recognised: bool = True
    cloud: PointCloud | None = None
    viewpoint: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class ObjectChange:
    """Something that was noticed: ``kind``: added, moved, removed, or replaced (something else stands there now).

    ``before``, ``after``: poses in the map frame, where they apply. ``stamp``: seconds, when it was noticed.
    """

    kind: Literal["added", "moved", "removed", "replaced"]
    name: str
    stamp: float
    before: Pose | None = None
    after: Pose | None = None


@dataclass(frozen=True, eq=False)
class HandleBelief:
    """A handle as last seen: in the map frame; ``furniture``: on which it was found, by the map, if on any."""

    name: str
    handle: Handle
    stamp: float
    furniture: str | None = None


@dataclass(frozen=True)
class HeldObject:
    """The object in the hand: ``tool_from_object`` as believed at the grasp."""

    name: str
    model: ObjectModel
    tool_from_object: Pose
    width: float


@dataclass(frozen=True)
class Obstacle:
    """A seen body without a model, or a measured surface: shapes in the map frame."""

    name: str
    shapes: tuple[PlacedShape, ...]
    stamp: float


@dataclass(frozen=True)
class BasePose:
    """Where the robot believes to be: ``pose`` in the map frame, standard deviations in metres and radians."""

    pose: Pose2D
    position_std: float
    heading_std: float
    stamp: float


@dataclass
class WorldModel:
    """The robot's belief; skills read and write it, the simulator never does.

    ``models``: objects that it knows by name. ``base``: its pose on the map. ``changes``: what was noticed of objects,
    oldest first. ``articulations``: how far doors and drawers, ``furniture/leaf``, are open, radians or metres; those
    that are not named are closed. ``occupancy``: what was seen to be free and filled, in the map frame; None before
    any scan.
    """

    map: SemanticMap
    models: dict[str, ObjectModel] = field(default_factory=dict)
    base: BasePose = field(default_factory=lambda: BasePose(Pose2D(), 1.0, 3.14, 0.0))
    objects: dict[str, ObjectBelief] = field(default_factory=dict)
    obstacles: dict[str, Obstacle] = field(default_factory=dict)
    handles: dict[str, HandleBelief] = field(default_factory=dict)
    changes: list[ObjectChange] = field(default_factory=list)
    held: HeldObject | None = None
    articulations: dict[str, float] = field(default_factory=dict)
    occupancy: VoxelGrid | None = None

    def as_at_the_start(self) -> WorldModel:
        """What is known before anything has been seen: the map, the models, and roughly where the base stands."""
        return WorldModel(map=self.map, models=dict(self.models), base=self.base)
