"""Examples: bestman-bt calibrate hand-eye my_views/; bestman-bt calibrate head --simulate diff_panda --views 20."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from bestman_bt.cli.options import Json, Seed, Settings, grouped_options, json_output
from bestman_bt.cli.run_view import CONSOLE
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import parse_settings
from bestman_bt.perception.calibration.boards import CalibrationError
from bestman_bt.perception.calibration.intrinsics import IntrinsicsCalibration
from bestman_bt.runtime.calibration.dataset import Progress as Report
from bestman_bt.runtime.calibration.dataset import load_dataset
from bestman_bt.runtime.calibration.simulated_recording import Kind, Simulated, compare, simulate
from bestman_bt.runtime.calibration.solve import (
    CalibrationResult,
    plot_residuals,
    solve_hand_eye,
    solve_head,
    solve_intrinsics,
)


class CalibrationKind(StrEnum):
    """The transform or lens to calibrate."""

    INTRINSICS = "intrinsics"
    HAND_EYE = "hand-eye"
    HEAD = "head"


class Method(StrEnum):
    """Closed forms of hand-eye calibration."""

    PARK_MARTIN = "park_martin"
    DANIILIDIS = "daniilidis"


class LensCoefficients(StrEnum):
    """Which coefficients of a lens are estimated."""

    NONE = "none"
    TWO = "k1_k2"
    FOUR = "k1_k2_p1_p2"
    FIVE = "k1_k2_p1_p2_k3"


@dataclass(frozen=True)
class SimulatedViews:
    """The simulated camera views to record; none if ``robot`` is None."""

    robot: Annotated[
        str | None, typer.Option("--simulate", metavar="ROBOT", help="Record the views with a simulated robot.")
    ] = None
    camera: Annotated[str | None, typer.Option(help="The camera, where the simulated robot has several.")] = None
    views: Annotated[int | None, typer.Option(min=4, help="How many views are simulated; 20, for a lens 40.")] = None
    seed: Seed = 0
    settings: Settings = None


@grouped_options
def command(
    what: Annotated[
        CalibrationKind, typer.Argument(help="The lens of a camera, one on an arm, or one on a pan-tilt head.")
    ],
    dataset: Annotated[
        Path | None, typer.Argument(metavar="[DATASET]", help="A folder with dataset.yaml and its images.")
    ] = None,
    simulation: SimulatedViews = SimulatedViews(),
    method: Annotated[Method, typer.Option(help="The closed form that a hand-eye calibration begins with.")] = (
        Method.PARK_MARTIN
    ),
    lens: Annotated[
        LensCoefficients, typer.Option(help="Which coefficients of the lens are estimated.")
    ] = LensCoefficients.FOUR,
    out: Annotated[
        Path | None, typer.Option(help="Folder for calibration.yaml and residuals.png; else that of the views.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Calibrate a camera from views of a board; writes a file for the ``calibration`` field of robot files."""
    if (dataset is None) == (simulation.robot is None):
        message = "give a dataset, or --simulate ROBOT, and not both"
        raise ConfigurationError([Problem("bestman-bt calibrate", None, "", message)])
    kind: Kind = what.value
    with json_output(as_json) as print_json:
        try:
            with _progress() as report:
                simulated = None
                folder = dataset or out or Path(f"calibration-{kind}-{simulation.seed}")
                if dataset is None:
                    simulated = _simulate(kind, simulation, folder, report)
                result = _solve(kind, folder, method, lens, report)
        except CalibrationError as error:
            print(f"bestman-bt: no calibration: {error}", file=sys.stderr)
            sys.exit(1)
        document = _finish(kind, result, out or folder, simulated)
        print_json(document)
    if not as_json:
        _print_text(document)
    sys.exit(0)


def _simulate(kind: Kind, asked: SimulatedViews, folder: Path, report: Report) -> Simulated:
    assert asked.robot is not None
    settings = _robot_settings(asked.settings)
    views = asked.views or (40 if kind == "intrinsics" else 20)
    return simulate(kind, asked.robot, settings, asked.camera, views, asked.seed, folder, report)


def _solve(kind: Kind, folder: Path, method: Method, lens: LensCoefficients, report: Report) -> CalibrationResult:
    recorded = load_dataset(folder)
    if kind == "intrinsics":
        return solve_intrinsics(recorded, IntrinsicsCalibration(lens=lens.value), report)
    if kind == "hand-eye":
        return solve_hand_eye(recorded, method.value, report)
    return solve_head(recorded, report)


def _finish(kind: Kind, result: CalibrationResult, folder: Path, simulated: Simulated | None) -> dict[str, Any]:
    folder.mkdir(parents=True, exist_ok=True)
    file, picture = folder / "calibration.yaml", folder / "residuals.png"
    result.write(file)
    plot_residuals(result, picture)
    document = {**result.to_document(), "file": str(file), "picture": str(picture)}
    if simulated is not None:
        document["against_the_truth"] = compare(kind, simulated, file)
    return document


def _robot_settings(settings: list[str] | None) -> dict[str, Any]:
    values = parse_settings(settings or ())
    wrong = [key for key in values if not key.startswith("robot.")]
    if wrong:
        message = "only settings of the robot (robot.…) have a meaning here"
        raise ConfigurationError([Problem(f"--set {key}", None, "", message) for key in wrong])
    return {key.removeprefix("robot."): value for key, value in values.items()}


@contextmanager
def _progress() -> Iterator[Report]:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, console=CONSOLE, transient=True) as progress:
        bars: dict[str, Any] = {}

        def report(what: str, done: int, total: int) -> None:
            if what not in bars:
                bars[what] = progress.add_task(what, total=total)
            progress.update(bars[what], completed=done)

        yield report


def _print_text(document: dict[str, Any]) -> None:
    used, recorded = document["views"]["used"], document["views"]["recorded"]
    error = document["reprojection_px"]["rms"]
    print(f"{document['camera']}: {used} of {recorded} views, corners {error:.2f} px from where they should be")
    for part, found in document["parts"].items():
        for field, value in found.items():
            for name, item in value.items() if isinstance(value, dict) else [(field, value)]:
                print(f"  {part}.{name}: {item}")
    for note in document.get("notes", ()):
        print(f"note: {note}")
    truth = document.get("against_the_truth", {})
    for name, value in truth.items():
        if not name.endswith("_before"):
            was = f" (file of the robot: {truth[f'{name}_before']:.3f})" if f"{name}_before" in truth else ""
            print(f"against the truth, {name}: {value:.3f}{was}")
    print(f"{document['file']} and {document['picture']} written; use it with")
    print(f"  bestman-bt run … --set robot.calibration=[{document['file']}]")
    print("or name it in the robot's file: calibration: [FILE]")
