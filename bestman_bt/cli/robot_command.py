"""Examples: bestman-bt robot show diff_ur5 --png ur5.png; bestman-bt robot import my_arm.urdf --srdf my_arm.srdf."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from bestman_bt.cli.bringup_command import bringup
from bestman_bt.cli.options import Json, Plugins, Png, Settings, confirmed, grouped_options, json_output, wrong_input
from bestman_bt.configuration.data import own_parts, pybullet_data
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import parse_settings
from bestman_bt.robot_model.model import ArmModel, JointGroupModel

verbs = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    no_args_is_help=True,
    help="Show, check and import robots and their parts, and download robot descriptions.",
    epilog=__doc__,
)
Name = Annotated[str, typer.Argument(help="A robot's name or YAML file, or BASE+ARM+HAND of three parts.")]


@verbs.command()
def show(name: Name, png: Png = None, posture: str = "home", plugins: Plugins = None, as_json: Json = False) -> None:
    """Show a robot's parts, joints, limits and sensors."""
    from bestman_bt.runtime.robot_facts import describe_robot, find_robot

    with json_output(as_json) as write:
        _load_plugins(plugins)
        model = find_robot(name)
        facts = describe_robot(model)
        if png is not None:
            facts["picture"] = _picture(model, png, posture)
        write(facts)
        if not as_json:
            _print_text(facts)


@verbs.command()
def check(
    name: Name,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the postures that the arm moves to.")] = 0,
    plugins: Plugins = None,
    as_json: Json = False,
) -> None:
    """Compose and load a robot, check that it stands still for 5 s, and move its arms to three postures."""
    from bestman_bt.runtime.robot_facts import find_robot
    from bestman_bt.runtime.self_test import TrialProcedure

    with json_output(as_json) as write:
        _load_plugins(plugins)
        trial = TrialProcedure().run(lambda: find_robot(name), seed)
        facts = {
            "name": name,
            "passed": trial.passed,
            "quick": trial.quick,
            "sound": trial.sound,
            "composed_s": round(trial.composed, 4),
            "loaded_s": round(trial.loaded, 3),
            "drift_m": round(trial.drift, 6),
            "moved_m": round(trial.after, 6),
            "postures": f"{trial.reached}/{trial.asked}",
            "touching": [list(pair) for pair in trial.touching],
        }
        write(facts)
        if not as_json:
            _print_text(facts)
    if not trial.passed:
        raise typer.Exit(1)


@verbs.command()
def postures(
    name: Name, seed: Annotated[int, typer.Option(min=0, help="Decides the samples.")] = 0, as_json: Json = False
) -> None:
    """Propose postures for a robot file: home, carry (out of the camera's view) and carry_beside."""
    import math

    import numpy as np

    from bestman_bt.manipulation.posture_search import PostureSearch
    from bestman_bt.runtime.robot_facts import find_robot

    with json_output(as_json) as write:
        model = find_robot(name)
        head = {
            joint: position
            for group in model.of(JointGroupModel).values()
            for joint, position in zip(group.joint_names[-2:], (0.0, math.radians(47.0)), strict=False)
        }
        found: dict[str, Any] = {}
        for arm in model.of(ArmModel):
            search, rng = PostureSearch(model, arm), np.random.default_rng(seed)
            names = model.of(ArmModel)[arm].joint_names
            home = model.posture("home", names) if "home" in model.postures else search.home(rng)
            carry, beside = search.carry(rng, home, head), search.carry_beside(rng, home, head)
            for posture, positions in (("home", home), ("carry", carry), ("carry_beside", beside)):
                found.setdefault(posture, {})[arm] = [round(float(value), 3) for value in positions]
        write({"postures": found})
        if not as_json:
            print("postures:")
            for posture, of_arms in found.items():
                print(f"  {posture}: {{{', '.join(f'{arm}: {values}' for arm, values in of_arms.items())}}}")


@verbs.command()
def descriptions(
    wheel: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A wheel of PyBullet that is here already; default: downloaded.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Download the robot models from PyBullet's wheel (pybullet_data), without the simulator."""
    from bestman_bt.runtime.robot_facts import REQUIREMENT, bring_pybullet_data

    with json_output(as_json) as write:
        there = pybullet_data()
        if there is None and wheel is None:
            print(f"downloading {REQUIREMENT} (100 MB) for the models in it ...", file=sys.stderr, flush=True)
        facts = {"folder": str(there or bring_pybullet_data(wheel)), "brought": there is None}
        write(facts)
        if not as_json:
            print(f"{'unpacked into' if facts['brought'] else 'here already:'} {facts['folder']}")


@dataclass(frozen=True)
class PartOptions:
    """The kind, name and links of the part to import from a URDF."""

    srdf: Annotated[Path | None, typer.Option(help="Its SRDF: groups, states and pairs that need no check.")] = None
    group: Annotated[str | None, typer.Option(help="Only this group of the SRDF.")] = None
    kind: Annotated[str | None, typer.Option(metavar="arm|gripper|base", help="Default: by its joints.")] = None
    name: Annotated[str | None, typer.Option(help="What robot files call it; default: the file's name.")] = None
    packages: Annotated[
        list[Path] | None, typer.Option("--package-path", metavar="DIR", help="Where packages of meshes are.")
    ] = None
    cut: Annotated[list[str] | None, typer.Option(metavar="LINK", help="Leave this link out, and what follows.")] = None


@verbs.command(name="move-into-limits")
def move_into_limits(
    name: Name,
    settings: Settings = None,
    yes: Annotated[bool, typer.Option("--yes", help="Move without asking: a person watches the robot.")] = False,
) -> None:
    """Slowly move joints of a real robot that are outside their configured range back into it."""
    from bestman_bt.robot_model.compose import load_robot_model
    from hal.hardware.into_limits import admit_outside, execute_return, return_motions
    from hal.hardware.robot import HardwareRobot
    from hal.parts.part_connection import ConnectionFailedError

    with json_output(False):
        keys = parse_settings(settings or [])
        model = load_robot_model(name, {key.removeprefix("robot."): value for key, value in keys.items()})
        robot = HardwareRobot(model)
    admit_outside(robot)
    try:
        with robot:
            ways = list(return_motions(robot))
            if not ways:
                print("all joints are within their ranges")
            for way in ways:
                print(f"{way.part}: {way}, at 5 % of the speed limits")
                if not yes:
                    typer.confirm("Is the path free, and is a person at the emergency stop?", abort=True)
                if fault := execute_return(robot, way):
                    print(f"bestman-bt: {way.part} has not returned: {fault}", file=sys.stderr)
                    raise typer.Exit(1)
    except ConnectionFailedError as error:
        print(f"bestman-bt: {error}", file=sys.stderr)
        raise typer.Exit(2) from error


verbs.command(name="bringup")(bringup)


@verbs.command(name="import")
@grouped_options
def import_urdf(
    urdf: Annotated[Path, typer.Argument(help="A URDF file (xacro expanded).")],
    wanted: PartOptions = PartOptions(),
    into: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for the part's file.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a part of this name.")] = False,
    png: Png = None,
    as_json: Json = False,
) -> None:
    """Create a part from any URDF: its kind, joints, limits, tool frame and postures are derived as far as possible."""
    from bestman_bt.robot_model.robot_config import name_fault
    from bestman_bt.robot_model.urdf_source import UrdfError, read_srdf
    from bestman_bt.runtime.part_import import PartRequest, import_part
    from bestman_bt.runtime.robot_facts import describe_robot

    with json_output(as_json) as write:
        if wanted.group is not None and wanted.srdf is None:
            raise wrong_input("--group", "is a group of an SRDF: also give --srdf")
        name = urdf.stem if wanted.name is None else wanted.name
        strange = name_fault(name)
        if strange is not None:
            raise wrong_input("--name", strange)
        file = (into or own_parts()) / f"{name}.yaml"
        if file.exists() and not force:
            raise wrong_input("--name", f"part {name!r} already exists ({file}); --force replaces it")
        request = PartRequest(name, wanted.kind, wanted.group, tuple(wanted.packages or ()), tuple(wanted.cut or ()))
        try:
            part = import_part(urdf, request, None if wanted.srdf is None else read_srdf(wanted.srdf))
        except UrdfError as error:
            own = f"{urdf.name}: "
            problems = [Problem(str(urdf), None, "", fault.removeprefix(own)) for fault in error.faults]
            raise ConfigurationError(problems) from error
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(part.description, encoding="utf-8")
        facts = {"part": part.name, "kind": part.kind, "file": str(file), "notes": list(part.notes)}
        facts |= {
            key: value for key, value in describe_robot(part.robot).items() if key not in ("name", "sensors") and value
        }
        if png is not None:
            facts["picture"] = _picture(part.robot, png, "home")
        write(facts)
        if not as_json:
            _print_text(facts)


@verbs.command()
def release(
    name: Name,
    yes: Annotated[bool, typer.Option("--yes", help="The robot has been inspected: do not ask.")] = False,
    settings: Settings = None,
    as_json: Json = False,
) -> None:
    """Show why a real robot's controllers are stopped, ask for an inspection, release them and log the user."""
    from bestman_bt.runtime.robot_release import held_controllers, log_release
    from hal.parts.part_connection import ConnectionFailedError

    with json_output(as_json) as write:
        released = []
        try:
            held = held_controllers(name, settings or ())
            for controller, cause in held:
                print(f"{controller.name}: {cause}", file=sys.stderr, flush=True)
                if not yes and not confirmed("Have you inspected the robot, and may it be released?"):
                    raise wrong_input(
                        "bestman-bt robot release", f"{controller.name} stays stopped: the inspection was not confirmed"
                    )
                controller.release()
                released.append(log_release(name, controller.name, cause))
        except ConnectionFailedError as error:
            raise wrong_input("bestman-bt robot release", str(error)) from error
        write({"released": released})
        if not as_json:
            for entry in released:
                print(f"{entry['controller']}: released by {entry['by']} at {entry['at']}")
            if not held:
                print("nothing is held: no controller needs a person")


@verbs.command()
def wrist(
    name: Name,
    yes: Annotated[bool, typer.Option("--yes", help="The arm is clear, and may move: do not ask.")] = False,
    settings: Settings = None,
    as_json: Json = False,
) -> None:
    """Turn a real robot's hand slowly by 30 degrees and compare its weight with the measured wrist force."""
    from bestman_bt.robot_model.model import ArmModel
    from bestman_bt.robot_model.sensor_parts import MountedForceTorque
    from bestman_bt.runtime.robot_release import real_robot
    from bestman_bt.runtime.wrist_check import check_wrist
    from hal.api import RobotError

    with json_output(as_json) as write:
        robot = real_robot(name, settings or ())
        arm = next((part for part in robot.parts if part in robot.model.of(ArmModel)), None)
        sensor = next((part for part in robot.parts if part in robot.model.of(MountedForceTorque)), None)
        if arm is None or sensor is None:
            raise wrong_input(name, "has no arm with a force-torque sensor behind its connections")
        if not yes and not confirmed("Is the hand empty and the space around the arm clear?"):
            raise wrong_input("bestman-bt robot wrist", "nothing has moved")
        try:
            with robot:
                found = check_wrist(robot, arm, sensor)
        except RobotError as error:
            raise wrong_input("bestman-bt robot wrist", str(error)) from error
        facts = {"joint": found.joint, "expected_n": round(found.expected, 2), "felt_n": round(found.felt, 2)}
        facts |= {"fault": found.fault}
        write(facts)
        if not as_json:
            _print_text(facts | {"fault": found.fault or "none"})
    if found.fault is not None:
        raise typer.Exit(1)


def _load_plugins(plugins: list[Path] | None) -> None:
    """Load the kinds of parts that a robot may consist of besides those of this package."""
    if plugins:
        from bestman_bt.runtime.plugins import node_registry

        node_registry([str(plugin) for plugin in plugins])


def _picture(model: Any, png: Path, posture: str) -> str:
    from PIL import Image

    from bestman_bt.runtime.pictures import robot_picture

    Image.fromarray(robot_picture(model, posture=posture)).save(png)
    return str(png)


def _print_text(facts: dict[str, Any]) -> None:
    for key, value in facts.items():
        if isinstance(value, dict):
            for name, inner in value.items():
                text = ", ".join(f"{k} {v}" for k, v in inner.items()) if isinstance(inner, dict) else str(inner)
                print(f"{key + ' ' + name:<22} {text}")
        elif isinstance(value, list):
            print(f"{key:<22} {'; '.join(map(str, value)) or 'none'}")
        else:
            print(f"{key:<22} {value}")
