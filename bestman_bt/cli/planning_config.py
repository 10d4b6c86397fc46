"""In which scene, with which robot, a plan is made."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from bestman_bt.configuration import RunConfig, load_run


def planning_config(
    task: str | None,
    scene: str | None,
    robot: str | None,
    seed: int,
    settings: Sequence[str] | None,
    plugins: Sequence[Path] | None,
) -> RunConfig:
    """Those of ``task``; without one the furnished kitchen and diff_panda, where nothing else is asked. ConfigurationError."""
    if task is None:
        scene, robot = scene or "kitchen_furnished", robot or "diff_panda"
    return load_run(
        task,
        tree="plan_and_execute",
        scene=scene,
        robot=robot,
        seed=seed,
        settings=settings or (),
        plugins=[str(plugin) for plugin in plugins or ()],
    )
