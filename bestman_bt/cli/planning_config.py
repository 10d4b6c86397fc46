"""In which scene, with which robot, and from what beliefs a plan is made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from bestman_bt.configuration import ConfigurationError, Problem, load_run

if TYPE_CHECKING:
    from bestman_bt.runtime import Setup
    from bestman_bt.world_model import WorldModel

TIME_LIMIT = "1200 s"
"""For what is planned without a task: to search a kitchen takes its time."""


def planning_state(
    task: str | None,
    scene: str | None,
    robot: str | None,
    seed: int,
    settings: Sequence[str] | None,
    plugins: Sequence[Path] | None,
    world: Path | None = None,
) -> tuple[Setup, WorldModel]:
    """The setup, and what is believed in it: at the start, or as in the file ``world``. ConfigurationError.

    The scene is that of ``task`` or of ``world``; without one the furnished kitchen, and diff_panda, where nothing else
    is asked.
    """
    from bestman_bt.runtime import prepare
    from bestman_bt.runtime.world_file import read_world

    file = None if world is None else read_world(world)
    added: list[str] = []
    if file is not None:
        if task is not None or scene is not None or seed != 0:
            message = f"is of the scene {file.scene} with seed {file.seed}; leave --task, --scene and --seed out"
            raise ConfigurationError([Problem(f"--world {world}", None, "", message)])
        scene, robot, seed, added = file.scene, robot or file.robot, file.seed, list(file.plugins)
    if task is None:
        scene, robot = scene or "kitchen_furnished", robot or "diff_panda"
        settings = (f"time_limit={TIME_LIMIT}", *(settings or ()))
    config = load_run(
        task,
        tree="plan_and_execute",
        scene=scene,
        robot=robot,
        seed=seed,
        settings=settings or (),
        plugins=[*added, *(str(plugin) for plugin in plugins or ())],
    )
    if file is not None:
        config = replace(config, scene_settings={**file.scene_settings, **config.scene_settings})
    setup = prepare(config)
    return setup, setup.world_model.as_at_the_start() if file is None else file.world_model(setup)
