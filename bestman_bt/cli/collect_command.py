"""Example: bestman-bt collect pick_place_table --episodes 50 --camera wrist_camera -o picks."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.options import (
    Engine,
    Json,
    LauncherOptions,
    Plugins,
    Robot,
    Scene,
    Settings,
    grouped_options,
    json_output,
    refuse_unwritable_folder,
)
from bestman_bt.cli.run_view import CONSOLE
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import RunConfig, RunRequest, run_of_options
from bestman_bt.evaluation.collection import ATTEMPTS, Collection
from bestman_bt.evaluation.launchers.worker_process import LauncherLostError
from bestman_bt.evaluation.result import RunResult
from bestman_bt.extras import DEFAULT_SIMULATOR
from bestman_bt.manipulation.policy.training.dataset_folder import FAILURES, DatasetError


class Format(StrEnum):
    """The layout of a dataset."""

    LEROBOT = "lerobot"


@dataclass(frozen=True)
class Wanted:
    """The episodes that the dataset should hold."""

    episodes: Annotated[int, typer.Option(min=1, help="Judged successes that the dataset should hold.")] = 10
    seed: Annotated[int, typer.Option(min=0, help="The first seed.")] = 0
    most: Annotated[
        int | None, typer.Option(min=1, help="Seeds to try; default: twice EPISODES.", show_default=False)
    ] = None
    words: Annotated[
        str | None, typer.Option(help="Language instruction; default: the task's description.", show_default=False)
    ] = None
    camera: Annotated[
        list[str] | None, typer.Option(help="A camera of the robot whose pictures are kept; may be repeated.")
    ] = None
    subtasks: Annotated[
        bool,
        typer.Option(
            "--subtasks", help="Keep what each skill does as language spans, which LeRobot 0.6 or later reads."
        ),
    ] = False
    failures: Annotated[
        bool, typer.Option(help="Keep the frames of failed episodes, too, as a dataset of their own in DIR/failures.")
    ] = True


@dataclass(frozen=True)
class World:
    """Overrides of the task's scene, robot and settings."""

    scene: Scene = None
    robot: Robot = None
    engine: Engine = DEFAULT_SIMULATOR
    settings: Settings = None
    plugins: Plugins = None

    def run(self, task: str, seed: int) -> RunConfig:
        """Return the configuration of the first episode. Raises ConfigurationError."""
        return run_of_options(
            RunRequest(
                task,
                scene=self.scene,
                robot=self.robot,
                seed=seed,
                settings=self.settings,
                plugins=self.plugins,
                driver=self.engine,
            )
        )


@grouped_options
def command(
    task: Annotated[str, typer.Argument(help="A shipped task or a YAML file, with goals.")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="The dataset; an existing one grows.")],
    wanted: Wanted = Wanted(),
    world: World = World(),
    execution: LauncherOptions = LauncherOptions(),
    layout: Annotated[Format, typer.Option("--format", help="Layout of the dataset.")] = Format.LEROBOT,
    as_json: Json = False,
) -> None:
    """Record judged successes of a task as a dataset of LeRobot, and failed episodes as another one beside them."""
    with json_output(as_json) as print_json:
        if problems := execution.problems():
            raise ConfigurationError(problems)
        refuse_unwritable_folder(out, "--out")
        config = world.run(task, wanted.seed)
        instruction = wanted.words or config.task.description or config.name.replace("_", " ")
        try:
            collection = Collection(config, out, instruction, wanted.camera or (), wanted.subtasks, wanted.failures)
        except DatasetError as error:
            raise ConfigurationError([Problem("--out", None, "", str(error))]) from error

        def show(result: RunResult) -> None:
            why = f": {result.failure.why}" if result.failure is not None else ""
            text = f"seed {result.seed}: {result.outcome}{why}; {collection.kept} of {wanted.episodes} episodes"
            CONSOLE.print(text, highlight=False, markup=False, soft_wrap=True)

        launcher, interrupted, lost = execution.made(out), "", list[str]()
        try:
            lost = collection.collect(wanted.episodes, wanted.most or 2 * wanted.episodes, show, launcher)
        except KeyboardInterrupt:
            interrupted = "interrupted: repeat the command to continue"
        except (LauncherLostError, DatasetError, OSError) as error:
            interrupted = str(error)
        print_json(
            {
                "folder": str(out),
                "format": layout,
                "episodes": collection.kept,
                "failures": collection.failures,
                "asked": wanted.episodes,
                "instruction": instruction,
                "notes": [*launcher.notes, *lost],
                "interrupted": interrupted,
            }
        )
    if not as_json:
        apart = f", {collection.failures} failures in {out / FAILURES}" if collection.failures else ""
        kept = f"{collection.kept} of {wanted.episodes} episodes{apart}"
        print(f"{out}: {kept}; every seed that was tried is in {ATTEMPTS}")
    remarks = [*launcher.notes, *lost]
    if interrupted:
        remarks += [interrupted, "episodes that had ended but waited for an earlier seed, if any, will be run again"]
    for remark in remarks:
        CONSOLE.print(f"bestman-bt: {remark}", highlight=False, markup=False, soft_wrap=True)
    sys.exit(130 if interrupted or lost else 0 if collection.kept >= wanted.episodes else 1)
