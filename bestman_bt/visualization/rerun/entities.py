"""Names inside a recording: timelines, entity paths and coordinate frames.

Rerun 0.41 takes an ``entity_path_prefix`` of one part for URDFs; a deeper one hides the robot silently.
"""

from __future__ import annotations

from typing import Final

SIM_TIME: Final = "sim_time"
TICK: Final = "tick"

MAP_FRAME: Final = "map"
ROBOT_FRAME_PREFIX: Final = "robot/"

WORLD: Final = "world"
TRANSFORMS: Final = f"{WORLD}/transforms"
STATIC_TRANSFORMS: Final = f"{WORLD}/static_transforms"
FLOOR: Final = f"{WORLD}/floor"
SCENE: Final = f"{WORLD}/scene"
MARKERS: Final = f"{WORLD}/markers"
PATHS: Final = f"{WORLD}/paths"
MAP: Final = f"{WORLD}/map"
BELIEFS: Final = f"{WORLD}/beliefs"
GRASPS: Final = f"{WORLD}/grasps"
SENSED: Final = f"{WORLD}/sensed"
CAMERA: Final = f"{WORLD}/camera"
TREE_GRAPH: Final = "tree"
NODES: Final = "node"
JOINTS: Final = "joints"
GRIPPERS: Final = "grippers"
LOG: Final = "log"
BLACKBOARD: Final = "blackboard"


def part(name: str) -> str:
    """Return ``name`` as one part of an entity path, without characters that Rerun would escape."""
    return "".join(character if character.isalnum() or character in "_-." else "_" for character in name)


def camera_entity(camera: str) -> str:
    """Return the pinhole of a camera; its colour and depth images lie below."""
    return f"{CAMERA}/{part(camera)}"


def lane_entity(position: int, label: str) -> str:
    """Return the lane of a node in the state timeline: lanes are sorted by path, so its position in the tree leads."""
    words = "".join(character if character.isalnum() or character == "_" else " " for character in label).split()
    return f"{NODES}/{'_'.join([f'{position:02d}', *words])}"
