"""Examples: bestman-bt robot bringup my_robot.yaml; … --step gripper; bestman-bt robot bringup diff_xarm6 --twin."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from bestman_bt.cli.options import Json, Settings, confirmed, json_output, pose, wrong_input
from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import parse_settings

SCENE = "pick_place_table"
"""Settings of the twins that replace the controllers."""


def bringup(
    name: Annotated[str, typer.Argument(help="A robot with connections: a shipped one, or a YAML file.")],
    step: Annotated[
        list[str] | None,
        typer.Option("--step", metavar="STEP", help="Only this step, even if it was done; repeatable."),
    ] = None,
    again: Annotated[bool, typer.Option("--again", help="Start again: discard earlier signatures.")] = False,
    board: Annotated[
        str | None,
        typer.Option(
            metavar="POSE",
            help="Where a 7×5 ChArUco board (40 mm) is, in the base: 'x y z roll pitch yaw', m, rad. Twins have one "
            "before their first camera, or there.",
        ),
    ] = None,
    twin: Annotated[bool, typer.Option("--twin", help="Bring up twins that are started for it, unattended.")] = False,
    yes: Annotated[
        bool, typer.Option("--yes", help="Do not ask for confirmation before motions. Requires a person at the robot.")
    ] = False,
    settings: Settings = None,
    as_json: Json = False,
) -> None:
    """Commission a real robot step by step; resumes where it stopped, and signs the results in a file."""
    from bestman_bt.bringup.brought_up_robot import BroughtUpRobot
    from bestman_bt.bringup.procedure import STEPS, Step, begun, left
    from bestman_bt.bringup.sensors import board_in_view
    from bestman_bt.robot_model.bringup_file import bringup_path
    from bestman_bt.robot_model.compose import load_robot_model

    known = {one.name: one for one in STEPS}
    for asked in step or ():
        if asked not in known:
            raise wrong_input(f"--step {asked}", f"no such step; there are {', '.join(known)}")
    given = _robot_settings(settings)

    def ask(one: Step) -> None:
        question = f"{one.name}: {one.moves}. Is the space clear, and is a person at the emergency stop?"
        if one.moves and not (yes or twin or confirmed(question)):
            raise wrong_input("bestman-bt robot bringup", f"{one.name} was not done: nothing has moved")

    if twin and board is None:
        board = board_in_view(load_robot_model(name, given))
    base_from_board = None if board is None else pose("--board", board)
    with json_output(as_json) as write, _controllers(name, given, twin, board) as reached:
        subject = BroughtUpRobot(name, reached, base_from_board=base_from_board, twin=twin)
        path = bringup_path(find_data("robot", name), twin)
        _check_connections(name, subject.model)
        file = begun(subject, path)
        if path.is_file() and not file.steps and not again:
            print(
                f"{path} was made for an earlier version of the robot's file: all steps are run again", file=sys.stderr
            )
        chosen = [known[one] for one in step] if step else list(STEPS) if again else left(file)
        failed = _do(subject, path, chosen, ask, again, quiet=as_json)
        file = begun(subject, path)
        write({"file": str(path), "signed": file.signed is not None, "steps": _plain(file.steps)})
        if not as_json:
            _print_end(path, file.signed, [one.name for one in left(file)])
    if failed:
        raise typer.Exit(1)


def _do(subject: Any, path: Path, steps: list[Any], ask: Callable[[Any], None], again: bool, quiet: bool) -> bool:
    """Run the steps and print their findings; returns whether one failed. ``again``: discard earlier signatures."""
    from bestman_bt.bringup.procedure import bring_up
    from hal.parts.part_connection import ConnectionFailedError

    failed = False
    try:
        with subject.robot:
            if again:
                path.unlink(missing_ok=True)
            for result in bring_up(subject, path, steps, ask):
                failed = result.outcome == "failed"
                if quiet:
                    continue
                print(f"{result.step:<16} {result.outcome}")
                for finding in result.findings:
                    print(f"  {finding.outcome:<14} {finding.subject}: {finding.text}", flush=True)
    except ConnectionFailedError as error:
        raise wrong_input("bestman-bt robot bringup", str(error)) from error
    return failed


def _print_end(path: Any, signed: Any, missing: list[str]) -> None:
    if signed is not None:
        print(f"signed by {signed.who} at {signed.when}: {path}")
    else:
        print(f"not signed yet; left: {', '.join(missing)} ({path})")


def _plain(steps: Any) -> dict[str, Any]:
    from dataclasses import asdict

    return {name: asdict(done) for name, done in steps.items()}


def _robot_settings(settings: list[str] | None) -> dict[str, Any]:
    values = parse_settings(settings or ())
    strange = [key for key in values if not key.startswith("robot.")]
    if strange:
        raise ConfigurationError([Problem(f"--set {key}", None, "", "should begin with robot.") for key in strange])
    return {key.removeprefix("robot."): value for key, value in values.items()}


@contextmanager
def _controllers(name: str, settings: dict[str, Any], twin: bool, board: str | None) -> Iterator[dict[str, Any]]:
    """Yield the settings of the controllers; twins run within the context."""
    if not twin:
        yield settings
        return
    from hal.twins.errors import TwinError
    from hal.twins.process import TwinProcess

    words = [f"robot.{key}={value}" for key, value in settings.items()]
    twins = TwinProcess(name, SCENE, settings=words, board=board)
    try:
        twins.start()
    except TwinError as error:
        raise wrong_input("--twin", str(error)) from error
    try:
        yield {**settings, **twins.settings}
    finally:
        twins.close()


def _check_connections(name: str, model: Any) -> None:
    from bestman_bt.registry import CONNECTIONS

    if not model.connections:
        raise ConfigurationError([Problem(name, None, "connections", "is missing, so there is nothing to bring up")])
    missing = [
        Problem(name, None, f"connections.{connection}.address", "is missing")
        for connection, settings in model.connections.items()
        if getattr(CONNECTIONS.resolve(settings.driver), "needs_address", True) and not settings.address
    ]
    if missing:
        raise ConfigurationError(missing)
