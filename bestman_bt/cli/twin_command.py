"""Examples: bestman-bt twin --robot my_xarm.yaml --scene pick_place_table; … --fault arm_controller:drop --at F."""

from __future__ import annotations

import json
import os
import shlex
import signal
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from bestman_bt.cli.options import Engine, Json, Seed, Settings, grouped_options, json_output, pose
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import parse_settings
from bestman_bt.extras import DEFAULT_SIMULATOR, EXTRA_OF_SIMULATOR, require_extra
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from hal.twins.errors import TwinError
from hal.twins.faults import delay_seconds
from hal.twins.tcp_server import ask
from hal.twins.twin_host import Hosted, TwinHost


@dataclass(frozen=True)
class TwinOptions:
    """The robot whose controllers the twins replace, and the world."""

    robot: Annotated[str, typer.Option(help="A shipped robot or a YAML file.")] = "diff_xarm6"
    scene: Annotated[str, typer.Option(help="A shipped scene or a YAML file.")] = "pick_place_table"
    seed: Seed = 0
    engine: Engine = DEFAULT_SIMULATOR
    board: Annotated[
        str | None,
        typer.Option(
            metavar="POSE", help="A 7×5 ChArUco board (40 mm) on the base: 'x y z roll pitch yaw' in it, m, rad."
        ),
    ] = None
    settings: Settings = None


@grouped_options
def command(
    asked: TwinOptions = TwinOptions(),
    judge: Annotated[
        bool, typer.Option("--judge", help="Open the judge's socket, with the ground truth for evaluation.")
    ] = False,
    fault: Annotated[
        str | None,
        typer.Option(metavar="CONNECTION:FAULT[:VALUE]", help="Make a fault happen in twins that run, and end."),
    ] = None,
    at: Annotated[
        Path | None, typer.Option(metavar="SOCKET", help="With --fault: the socket that the twins printed.")
    ] = None,
    until_eof: Annotated[
        bool, typer.Option("--until-eof", help="End with the standard input: with the program that started this.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Emulate a robot's controllers: their wire protocols over a simulated world, in real time, until Ctrl-C."""
    if fault is not None:
        _make_fault(fault, at)
        return
    with json_output(as_json):
        try:
            host = _host(asked, judge)
        except TwinError as error:
            raise ConfigurationError([Problem("bestman-bt twin", None, "", str(error))]) from error

    host.world.watch.report = lambda words: print(f"bestman-bt twin: {words}", file=sys.stderr, flush=True)

    def end(number: int, frame: FrameType | None) -> None:
        host.close()

    signal.signal(signal.SIGINT, end)
    signal.signal(signal.SIGTERM, end)
    if until_eof:
        threading.Thread(target=_close_at_eof, args=(host,), daemon=True).start()
    try:
        host.run(lambda hosted: _print_text(hosted, as_json))
    except TwinError as error:
        raise ConfigurationError([Problem("bestman-bt twin", None, "", str(error))]) from error


def _host(asked: TwinOptions, judge: bool) -> TwinHost:
    require_extra("simulation", EXTRA_OF_SIMULATOR[asked.engine])
    values = parse_settings(asked.settings or ())
    inner = {
        kind: {key.removeprefix(f"{kind}."): value for key, value in values.items() if key.startswith(f"{kind}.")}
        for kind in ("robot", "scene")
    }
    strange = [key for key in values if not key.startswith(("robot.", "scene."))]
    if strange:
        problems = [Problem(f"--set {key}", None, "", "should begin with robot. or scene.") for key in strange]
        raise ConfigurationError(problems)
    model = load_robot_model(asked.robot, inner["robot"])
    if asked.board is not None:
        from bestman_bt.bringup.sensors import BOARD
        from bestman_bt.runtime.calibration.board_link import with_board

        model = with_board(model, BOARD, model.base_frame, pose("--board", asked.board))
    world = draw_world(load_scene(asked.scene, inner["scene"]), asked.seed)
    return TwinHost(model, world, asked.seed, judge, asked.engine)


def _print_text(hosted: Hosted, as_json: bool) -> None:
    document = hosted.document()
    if as_json:
        print(json.dumps(document), flush=True)
        return
    for name, address in hosted.addresses.items():
        print(f"{name}: {address}")
    print("drive it with: --driver hardware " + " ".join(f"--set {shlex.quote(s)}" for s in document["settings"]))
    print(f"make faults with: bestman-bt twin --fault CONNECTION:FAULT --at {hosted.faults}")
    if hosted.judge is not None:
        print(f"judge: {hosted.judge}")
    sys.stdout.flush()


def _close_at_eof(host: TwinHost) -> None:
    while os.read(sys.stdin.fileno(), 1024):
        pass
    host.close()


def _make_fault(fault: str, at: Path | None) -> None:
    connection, _, rest = fault.partition(":")
    name, _, value = rest.partition(":")
    if at is None or not name:
        raise ConfigurationError(
            [Problem("--fault", None, "", "give CONNECTION:FAULT, and with --at the socket that the twins printed")]
        )
    question: dict[str, object] = {"connection": connection, "fault": name}
    try:
        if name == "delay":
            question["value"] = delay_seconds(value or None)
        elif value:
            question["value"] = value
        ask(at, question)
    except OSError as error:
        message = f"no twins answer there: {error.strerror or error}; they print their socket when they start"
        raise ConfigurationError([Problem(f"--at {at}", None, "", message)]) from error
    except (LookupError, ValueError) as error:
        raise ConfigurationError([Problem(f"--fault {fault}", None, "", str(error))]) from error
