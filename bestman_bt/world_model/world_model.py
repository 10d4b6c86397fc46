"""What the robot believes: where it is, which objects it has seen, what it holds."""

from __future__ import annotations

from dataclasses import dataclass, field

from bestman_bt.messages import ObjectModel, PlacedShape, Pose, Pose2D
from bestman_bt.world_model.semantic_map import SemanticMap


@dataclass(frozen=True)
class ObjectBelief:
    """An object as last seen: ``pose`` in the map frame, ``confidence`` 0 to 1, ``stamp`` seconds.

    ``position_std``: metres. ``surface``: the name of the surface that it stands on, if any.
    """

    name: str
    model: ObjectModel
    pose: Pose
    confidence: float
    position_std: float
    stamp: float
    surface: str | None = None


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

    ``models``: objects that it knows by name. ``base``: its pose on the map.
    """

    map: SemanticMap
    models: dict[str, ObjectModel] = field(default_factory=dict)
    base: BasePose = field(default_factory=lambda: BasePose(Pose2D(), 1.0, 3.14, 0.0))
    objects: dict[str, ObjectBelief] = field(default_factory=dict)
    obstacles: dict[str, Obstacle] = field(default_factory=dict)
    held: HeldObject | None = None
