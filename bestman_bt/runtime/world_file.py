"""Saved world models: a YAML file with the robot's beliefs, and the scene of its map and models."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from bestman_bt.configuration.checked import check
from bestman_bt.configuration.data import beside
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.quantity import WholeNumber
from bestman_bt.runtime.resolved_config import ResolvedConfig
from bestman_bt.world_model.saved_beliefs import SavedBeliefs, restored, saved
from bestman_bt.world_model.world_model import WorldModel

WORLD_NAME = "world.yaml"
"""Name of the file in a run folder."""
_HEADER = "# What the robot believed at the end of a run; bestman-bt plan --world FILE plans from it.\n"


@dataclass(frozen=True)
class WorldFile:
    """Saved beliefs, with the world (``scene``, ``seed``, ``scene_settings``) and the ``robot`` that they belong to."""

    scene: str
    robot: str = "diff_panda"
    seed: WholeNumber = 0
    scene_settings: Mapping[str, Any] = field(default_factory=dict)
    plugins: tuple[str, ...] = ()
    beliefs: SavedBeliefs = field(default_factory=SavedBeliefs)
    written: Document = field(default_factory=lambda: Document({}), init=False, repr=False, compare=False)

    def world_model(self, setup: ResolvedConfig) -> WorldModel:
        """Return a world model with these beliefs, and the map and models of a setup.

        Raises ConfigurationError for names that these do not contain.
        """
        try:
            return restored(self.beliefs, self.written, setup.world_model)
        except ConfigurationError as error:
            raise error.within("beliefs") from error


def read_world(path: Path) -> WorldFile:
    """Read a world file written by a run or by hand.

    Raises ConfigurationError listing every fault with its line.
    """
    document = read_document(path)
    for kind in ("scene", "robot"):
        if isinstance(document.data.get(kind), str):
            document.data[kind] = beside(path, kind, document.data[kind])
    plugins = document.data.get("plugins")
    if isinstance(plugins, list):
        document.data["plugins"] = [str(path.parent / name) if isinstance(name, str) else name for name in plugins]
    file = check(document, WorldFile)
    beliefs = document.below("beliefs") if "beliefs" in document.data else Document({})
    object.__setattr__(file, "written", beliefs)
    return file


def write_world(path: Path, setup: ResolvedConfig, world: WorldModel) -> None:
    """Write the robot's beliefs after a run."""
    config = setup.config
    document = {
        "scene": _from_anywhere("scene", config.task.scene),
        "robot": _from_anywhere("robot", config.task.robot),
        "seed": config.seed,
        "scene_settings": dict(config.scene_settings),
        "plugins": [str(Path(plugin).resolve()) for plugin in config.task.plugins],
        "beliefs": saved(world, setup.world_model.map),
    }
    path.write_text(_HEADER + yaml.safe_dump(document, sort_keys=False, allow_unicode=True), encoding="utf-8")


def _from_anywhere(kind: str, name: str) -> str:
    """Return a bare name as it is, a path as an absolute one."""
    return name if beside(Path("a/b"), kind, name) == name else str(Path(name).resolve())
