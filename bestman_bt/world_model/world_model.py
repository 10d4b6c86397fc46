"""The robot's belief: its base pose, observed objects and handles, held objects."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, Handle, ObjectModel, PlacedShape, PointCloud, Pose, Pose2D, VoxelGrid, YawSet
from bestman_bt.messages.grids import VOXEL_FREE, VOXEL_OCCUPIED
from bestman_bt.world_model.semantic_map import MapArticulation, MapFurniture, MapSurface, SemanticMap

HANDLE_STANDOFF = 0.10
"""Metres, largest distance of a handle from its front."""

MOVED = 0.01
"""Metres or radians beyond which a door or drawer counts as moved."""


@dataclass(frozen=True, eq=False)
class ObjectBelief:
    """An object as last observed: ``pose`` in the map frame, ``confidence`` 0 to 1, ``stamp`` seconds.

    The confidence is that of the fitted model: 1 for an object without a model, 0 if the model of its name does not
    fit.
    ``name``: its identity: the name of the model, numbered if several are known (``can_2``); ``thing_1`` for an unknown
    object. ``position_std``: metres. ``surface``: the surface that it stands on, if any. ``yaw_set``: the possible
    yaws. ``since``: seconds, when it was first observed there. ``recognised``: False if its model is only the measured
    box. ``cloud``: its points in the map frame, and ``viewpoint``: (3,), from where they were measured. ``score``: of
    the detector, 0 to 1, if it gives one.
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
    score: float | None = None

    def moved(self, map_from_before: Pose) -> ObjectBelief:
        """Return the belief moved along with its support."""
        return replace(
            self,
            pose=map_from_before @ self.pose,
            yaw_set=self.yaw_set.turned(map_from_before.yaw),
            cloud=None if self.cloud is None else self.cloud.transformed(map_from_before),
            viewpoint=None if self.viewpoint is None else map_from_before.apply(self.viewpoint[None])[0],
        )


@dataclass(frozen=True)
class ObjectChange:
    """A detected change; ``kind``: added, moved, removed, or replaced by a different object.

    ``before``, ``after``: poses in the map frame, where they apply. ``stamp``: seconds, of the detection.
    """

    kind: Literal["added", "moved", "removed", "replaced"]
    name: str
    stamp: float
    before: Pose | None = None
    after: Pose | None = None


@dataclass(frozen=True, eq=False)
class HandleBelief:
    """A handle as last observed, in the map frame; ``furniture``: the piece that it belongs to, if known."""

    name: str
    handle: Handle
    stamp: float
    furniture: str | None = None


@dataclass(frozen=True)
class HeldObject:
    """An object in a hand; ``tool_from_object``: believed at the grasp; ``width``: metres between the fingers."""

    name: str
    model: ObjectModel
    tool_from_object: Pose
    width: float


@dataclass(frozen=True)
class Obstacle:
    """An observed body without a model, or a measured surface: shapes in the map frame."""

    name: str
    shapes: tuple[PlacedShape, ...]
    stamp: float


@dataclass(frozen=True)
class BasePose:
    """The believed ``pose`` of the base in the map frame, standard deviations in metres and radians."""

    pose: Pose2D
    position_std: float
    heading_std: float
    stamp: float


@dataclass
class WorldModel:
    """The robot's belief; skills read and write it, the simulator never does.

    ``models``: known objects, by name. ``base``: its pose on the map. ``hands``: arm → held object, only for hands that
    hold something. ``changes``: detected changes of objects, oldest first. ``articulations``: openings of doors and
    drawers, ``furniture/name``, radians or metres; those not listed are closed; initially from the map. ``occupancy``:
    free and occupied space in the map frame, or None before any scan. ``searched``: (object, surface) → seconds of the
    last search in vain; ``searched_in_part``: searches during which a part of the surface was hidden.
    ``given_places``: object → surface, as given by the user. ``locked``: doors and drawers that did not open.
    ``blocked``: surfaces that were unreachable, and doors and drawers that could not be opened for a temporary reason;
    cleared when a door or drawer moves. ``in_the_way``: (door or drawer, surface) for surfaces that were unreachable
    while it was open. ``achieved_effects``: those of your own abilities that have succeeded, as facts, latest last.
    """

    map: SemanticMap
    models: dict[str, ObjectModel] = field(default_factory=dict)
    base: BasePose = field(default_factory=lambda: BasePose(Pose2D(), 1.0, 3.14, 0.0))
    objects: dict[str, ObjectBelief] = field(default_factory=dict)
    obstacles: dict[str, Obstacle] = field(default_factory=dict)
    handles: dict[str, HandleBelief] = field(default_factory=dict)
    changes: list[ObjectChange] = field(default_factory=list)
    hands: dict[str, HeldObject] = field(default_factory=dict)
    articulations: dict[str, float] = field(default_factory=dict)
    occupancy: VoxelGrid | None = None
    searched: dict[tuple[str, str], float] = field(default_factory=dict)
    searched_in_part: set[tuple[str, str]] = field(default_factory=set)
    given_places: dict[str, str] = field(default_factory=dict)
    locked: set[str] = field(default_factory=set)
    blocked: set[str] = field(default_factory=set)
    in_the_way: set[tuple[str, str]] = field(default_factory=set)
    achieved_effects: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        for piece in self.map.furniture.values():
            for door in piece.articulations:
                if door.position > 0.0:
                    self.articulations.setdefault(f"{piece.name}/{door.name}", door.position)

    def initial_beliefs(self) -> WorldModel:
        """Return the knowledge before any observation: map, models, given places and the initial base pose."""
        return WorldModel(map=self.map, models=dict(self.models), base=self.base, given_places=dict(self.given_places))

    def record_effects(self, effects: str) -> None:
        """Record the effects of an ability that has succeeded; ``effects``: as declared, with its parameters filled
        in.
        """
        self.achieved_effects = [*(known for known in self.achieved_effects if known != effects), effects]

    def may_be_on(self, name: str, surface: str) -> bool:
        """Return whether an object of unknown place may be on a surface: it was not searched there since it was lost.

        An object with a given place may be only there until that place has been searched.
        """
        if name in self.objects or self.arm_with(name) is not None:
            return False
        noticed = max((change.stamp for change in self.changes if change.name == name), default=0.0)

        def searched(place: str) -> bool:
            return self.searched.get((name, place), -1.0) >= noticed

        given = self.given_places.get(name)
        return not searched(surface) and (given in (None, surface) or searched(str(given)))

    def arm_with(self, name: str) -> str | None:
        """Return the arm whose hand holds an object, or None if none does."""
        return next((arm for arm, held in self.hands.items() if held.name == name), None)

    def surface(self, name: str) -> tuple[MapFurniture, MapSurface]:
        """Return the surface as ``SemanticMap.surface`` does, a drawer's at its believed opening."""
        furniture, surface = self.map.surface(name)
        if surface.drawer is None:
            return furniture, surface
        opened = self.opening_of(furniture, furniture.articulation(surface.drawer))
        return furniture, replace(surface, pose=opened @ surface.pose)

    def opening_of(self, furniture: MapFurniture, door: MapArticulation) -> Pose:
        """Return furniture_from_closed of the door at its believed opening."""
        return door.moved(self.articulations.get(f"{furniture.name}/{door.name}", 0.0))

    def believe_articulation(self, name: str, position: float) -> tuple[str, ...]:
        """Set the believed opening of the door or drawer ``furniture/name`` to ``position``, radians or metres.

        Its handle, the contents of a drawer and the measured board move along. Returns the names of the moved objects.
        """
        piece_name, _, part = name.partition("/")
        piece = self.map.furniture[piece_name]
        door, frame = piece.articulation(part), piece.pose.to_pose()
        before, handles = self.opening_of(piece, door), self.handles_of(piece, door)
        if abs(position - self.articulations.get(name, 0.0)) > MOVED:
            self.blocked.clear()
            self._free(PlacedShape(door.hull.shape, frame @ before @ door.hull.pose))
        self.articulations[name] = position
        moved = frame @ self.opening_of(piece, door) @ before.inverse() @ frame.inverse()
        boards = {f"{piece_name}/{surface.name}" for surface in piece.surfaces if surface.drawer == part}
        for on_door in handles:
            self.handles[on_door.name] = replace(on_door, handle=on_door.handle.seen_from(moved))
        carried = [belief for belief in self.objects.values() if belief.surface in boards]
        for belief in carried:
            self.objects[belief.name] = belief.moved(moved)
        for board in boards:
            measured = self.obstacles.get(f"{board}/surface")
            if measured is not None:
                shapes = tuple(PlacedShape(placed.shape, moved @ placed.pose) for placed in measured.shapes)
                self.obstacles[measured.name] = replace(measured, shapes=shapes)
        return tuple(belief.name for belief in carried)

    def _free(self, hull: PlacedShape) -> None:
        """Remove the beliefs about everything that was seen in a box of the map."""
        grid = self.occupancy
        if grid is None or not isinstance(hull.shape, Box):
            return
        occupied = np.argwhere(grid.states == VOXEL_OCCUPIED)
        centres = grid.frame_from_grid.apply((occupied + 0.5) * grid.resolution)
        inside = np.abs(hull.pose.inverse().apply(centres)) <= (np.array(hull.shape.size) + grid.resolution) / 2
        states = np.array(grid.states)
        states[tuple(occupied[inside.all(axis=1)].T)] = VOXEL_FREE
        self.occupancy = replace(grid, states=states)

    def handles_of(self, furniture: MapFurniture, door: MapArticulation) -> tuple[HandleBelief, ...]:
        """Return the believed handles on the front of a door or drawer."""
        front = door.shapes[0]
        if not isinstance(front.shape, Box):
            return ()
        map_from_front = furniture.pose.to_pose() @ self.opening_of(furniture, door) @ front.pose
        room = np.array(front.shape.size) / 2 + (HANDLE_STANDOFF, 0.0, 0.0)
        return tuple(
            belief
            for belief in self.handles.values()
            if belief.furniture == furniture.name
            and bool(np.all(np.abs(map_from_front.inverse().apply(belief.handle.pose.position[None])[0]) < room))
        )
