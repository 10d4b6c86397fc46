"""Renders a finished run: stills and a film, by the simulator's fast renderer or by Blender.

The rendered world is a copy without simulation: poses are set and no time passes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import gaussian_filter1d

from bestman_bt.evaluation.film.filmed_run import FilmedRun, FilmError
from bestman_bt.evaluation.recording import recorded_bodies
from bestman_bt.extras import DEFAULT_SIMULATOR, install_command
from bestman_bt.messages import Pose, wrap_angle
from bestman_bt.registry import DRIVERS
from bestman_bt.robot_model.model import GripperModel
from bestman_bt.scene.scene import Articulation, PlacedFurniture, Wall, World
from bestman_bt.visualization.blender.painting import (
    BlenderBody,
    BlenderFrame,
    BlenderJob,
    BlenderRobot,
    Finish,
    blender_python,
    paint,
)
from bestman_bt.visualization.snapshot import RobotSnapshot
from hal.simulation.bodies import Viewpoint
from hal.simulation.camera import smooth
from hal.simulation.guards import ReadPurpose
from hal.simulation.robot import SimulatedRobot

BEHIND = 0.35
"""Metres behind the target within which a wall still hides it."""


def blender_job(
    run: FilmedRun,
    frames: Sequence[tuple[RobotSnapshot, Viewpoint]],
    files: Sequence[Path],
    size: tuple[int, int],
    samples: int,
) -> BlenderJob:
    """Return the job that renders ``frames`` into ``files``; ``size``: width and height in pixels."""
    views = [view for _, view in frames]
    hidden = {name for name, wall in _walls(run.world) if any(_hides(wall, view) for view in views)}
    return BlenderJob(
        robot=BlenderRobot(run.robot_model.urdf, run.robot_model.base_frame),
        bodies=list(_painted_bodies(run.world)),
        frames=[
            BlenderFrame(snapshot, view.eye, view.target, view.field_of_view, file)
            for (snapshot, view), file in zip(frames, files, strict=True)
        ],
        hidden=frozenset(hidden),
        width=size[0],
        height=size[1],
        samples=samples,
        seed=run.config.seed,
    )


def _painted_bodies(world: World) -> Iterable[BlenderBody]:
    finishes: dict[str, Finish] = {name: "wall" for name, _ in _walls(world)}
    finishes |= {thing.name: "object" for thing in world.objects}
    finishes |= {walker.name: "person" for walker in world.walkers}
    for body in recorded_bodies(world):
        yield BlenderBody(body, finishes.get(body.name, "furniture"))


def _walls(world: World) -> list[tuple[str, Wall]]:
    """Return the walls with the names of their bodies."""
    return [(f"wall{number}", wall) for number, wall in enumerate(world.walls)]


def _hides(wall: Wall, view: Viewpoint) -> bool:
    """Return whether a wall stands between the camera and what it looks at, in plan, or right behind the camera."""
    eye, target = np.array(view.eye[:2]), np.array(view.target[:2])
    away = target - eye
    length = float(np.linalg.norm(away))
    direction = away / length if length > 0 else np.array([1.0, 0.0])
    side = np.array([-direction[1], direction[0]])
    start, end = (np.array(point) - eye for point in (wall.start, wall.end))
    reach = length - BEHIND
    for share in np.linspace(0.0, 1.0, 40):
        point = start + share * (end - start)
        ahead, across = float(point @ direction), float(point @ side)
        if -BEHIND < ahead < reach and abs(across) < 0.5 * max(ahead, 0.0) + BEHIND:
            return True
    return False


SMALL_FILM = 1_500_000
SMALL_STILL = 200_000


def caption(run: FilmedRun, shot: Shot, time: float) -> str:
    """Return the caption at a second of the run."""
    return f"{run.config.name}   {time:5.1f} s   {shot.speed:.2g} x   {run.doing(time)}"


def captioned(picture: NDArray[np.uint8], text: str) -> NDArray[np.uint8]:
    """Return the picture with a line of text at the lower edge."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image, "RGBA")
    draw.rectangle((0, image.height - 24, image.width, image.height), fill=(20, 24, 28, 170))
    draw.text((10, image.height - 20), text, font=ImageFont.load_default(14), fill=(255, 255, 255, 255))
    return np.asarray(image)


def write_still(picture: NDArray[np.uint8], path: Path, largest: int = SMALL_STILL) -> None:
    """Write a JPEG of at most ``largest`` bytes, or the smallest possible one."""
    image = Image.fromarray(picture)
    for quality in (92, 88, 80, 70, 60):
        image.save(path, quality=quality, optimize=True)
        if path.stat().st_size <= largest:
            return


def require_film_writer() -> None:
    """Raise FilmError if films cannot be written; call it before rendering."""
    try:
        import av  # noqa: F401 - only whether it is there
    except ImportError as error:
        raise FilmError(f"films need PyAV: {install_command('video')}") from error


def write_film(pictures: Iterable[NDArray[np.uint8]], path: Path, largest: int = SMALL_FILM) -> None:
    """Write an mp4 (H.264) of at most ``largest`` bytes, or the smallest possible one. Raises FilmError without its
    writer.
    """
    require_film_writer()
    import av

    frames = list(pictures)
    height, width = frames[0].shape[:2]
    for quality in (21, 25, 29, 33, 37):
        with av.open(str(path), "w", options={"movflags": "faststart"}) as out:
            stream = out.add_stream("libx264", rate=RATE, options={"crf": str(quality), "preset": "slow"})
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            for frame in frames:
                out.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
            out.mux(stream.encode())
        if path.stat().st_size <= largest:
            return


LARGEST_STILL = 600_000
LARGEST_FILM = 6_000_000


@dataclass(frozen=True)
class RenderOptions:
    """Options of the pictures of a run.

    ``at``: seconds of the run for stills; empty: the most informative moment. ``film``: also make an mp4. ``blender``:
    render with Blender; ``samples``: its light paths per pixel. ``size``: pixels, even.
    """

    at: tuple[float, ...] = ()
    film: bool = False
    blender: bool = False
    size: tuple[int, int] = (960, 720)
    samples: int = 32


def render(run: FilmedRun, out: Path, options: RenderOptions, report: Callable[[str], None]) -> list[Path]:
    """Write ``still-<seconds>.jpg`` and, if requested, ``film.mp4`` into ``out``; returns the written files.

    Raises FilmError or BlenderError, before rendering if something is missing.
    """
    late = [time for time in options.at if not 0.0 <= time <= run.motion.duration]
    if late:
        raise FilmError(f"the run has no second {late[0]:g}: it goes from 0 to {run.motion.duration:.2f}")
    if any(not 64 <= pixels <= 4096 or pixels % 2 for pixels in options.size):
        raise FilmError(f"the size should be two even numbers from 64 to 4096, but is {options.size}")
    if options.film:
        require_film_writer()
    python = blender_python() if options.blender else None
    with _written_into(out):
        out.mkdir(parents=True, exist_ok=True)
    with ReplayScene(run) as stage:
        report("choosing the camera position")
        shot = plan_shot(run, stage)
        stills = options.at or (shot.times[best_frame(run, shot, stage)],)
        times = [*stills, *(shot.times if options.film else ())]
        frames = [(run.motion.at(time), shot.view_at(time)) for time in times]
        if python is not None:
            pictures = _painted(run, frames, options, python, report)
        else:
            pictures = _photographed(stage, frames, options, report)
    written = []
    with _written_into(out):
        for time, picture in zip(stills, pictures, strict=False):
            written.append(out / f"still-{time:06.2f}.jpg")
            write_still(picture, written[-1], LARGEST_STILL)
        if options.film:
            written.append(out / "film.mp4")
            captions = [caption(run, shot, time) for time in shot.times]
            film = [captioned(picture, text) for picture, text in zip(pictures[len(stills) :], captions, strict=True)]
            write_film(film, written[-1], LARGEST_FILM)
    return written


@contextmanager
def _written_into(out: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise FilmError(f"{out} cannot be written: {error.strerror or error}") from error


Frame = tuple[RobotSnapshot, Viewpoint]


def _photographed(
    stage: ReplayScene, frames: Sequence[Frame], options: RenderOptions, report: Callable[[str], None]
) -> list[NDArray[np.uint8]]:
    """Render with the simulator's renderer: a few seconds for a picture of 960×720."""
    pictures = []
    for snapshot, view in frames:
        stage.set(snapshot)
        pictures.append(stage.picture(view, *options.size, oversampling=2))
        report(f"picture {len(pictures)} of {len(frames)}")
    return pictures


def _painted(
    run: FilmedRun, frames: Sequence[Frame], options: RenderOptions, python: Path, report: Callable[[str], None]
) -> list[NDArray[np.uint8]]:
    """Render with Blender: many seconds for a picture."""
    with TemporaryDirectory() as name:
        files = [Path(name) / f"{number:05d}.png" for number in range(len(frames))]
        job = blender_job(run, frames, files, options.size, options.samples)
        done: list[Path] = []

        def on_frame(file: Path) -> None:
            done.append(file)
            report(f"picture {len(done)} of {len(frames)}")

        paint(job, python, on_frame)
        return [np.asarray(Image.open(file).convert("RGB")) for file in files]


RATE = 12
"""Frames per second."""
SECONDS = (8.0, 13.0)
"""Shortest and longest film; a shorter run is shown at its original speed."""
SHORTEST = 0.5
AZIMUTHS = np.arange(12) * math.pi / 6
ELEVATIONS = (math.radians(25.0), math.radians(40.0))
DISTANCE = 2.3
FIELD_OF_VIEW = 42.0
ENOUGH = (0.004, 0.01)
"""Fractions of the picture from which the hand and the handled object are sufficiently visible."""
KEY_MOMENTS = 10


@dataclass(frozen=True)
class Shot:
    """Frames of a film at ``times``, seconds of the run. ``targets``: (N, 3), points to look at. ``speed``: playback
    speed factor.
    """

    times: tuple[float, ...]
    snapshots: tuple[RobotSnapshot, ...]
    targets: NDArray[np.float64]
    azimuth: float
    elevation: float
    speed: float

    def view(self, index: int) -> Viewpoint:
        """Return the viewpoint of one frame."""
        return viewpoint(self.targets[index], self.azimuth, self.elevation)

    def view_at(self, time: float) -> Viewpoint:
        """Return the viewpoint at any second of the run, interpolated between frames."""
        target = np.array([np.interp(time, self.times, self.targets[:, axis]) for axis in range(3)])
        return viewpoint(target, self.azimuth, self.elevation)


def viewpoint(target: NDArray[np.float64], azimuth: float, elevation: float) -> Viewpoint:
    """Return a viewpoint at DISTANCE metres, ``azimuth`` and ``elevation`` radians in the map frame."""
    away = np.array(
        [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
    )
    x, y, z = (float(value) for value in target + DISTANCE * away)
    a, b, c = (float(value) for value in target)
    return Viewpoint((x, y, z), (a, b, c), FIELD_OF_VIEW)


def plan_shot(run: FilmedRun, stage: ReplayScene) -> Shot:
    """Choose the frames of the shot, the side of the camera and its path."""
    duration = run.motion.duration
    seconds = max(min(max(duration / 4.0, SECONDS[0]), SECONDS[1], duration), SHORTEST)
    times = tuple(float(time) for time in np.linspace(0.0, duration, round(seconds * RATE)))
    snapshots = tuple(run.motion.at(time) for time in times)
    hands = []
    for snapshot in snapshots:
        stage.set(snapshot)
        hands.append(stage.hand())
    bases = np.array([snapshot.map_from_base.position for snapshot in snapshots])
    middle = 0.35 * bases + 0.65 * np.array(hands)
    middle[:, 2] = 0.75
    targets = gaussian_filter1d(middle, sigma=0.8 * RATE, axis=0, mode="nearest")
    moved = np.linalg.norm(np.gradient(bases, axis=0), axis=1)
    standing = np.flatnonzero(moved < 1e-3) if (moved < 1e-3).any() else np.arange(len(times))
    keys = standing[np.linspace(0, len(standing) - 1, KEY_MOMENTS).round().astype(int)]

    def score(side: tuple[float, float]) -> float:
        """Return how well hand and subjects are visible while the base stands."""
        total = 0.0
        for index in keys:
            stage.set(snapshots[index])
            total += _clearness(stage.seen(viewpoint(targets[index], *side), run.subjects), 1.0)
        return total

    azimuth, elevation = max(((float(a), e) for a in AZIMUTHS for e in ELEVATIONS), key=score)
    return Shot(times, snapshots, targets, azimuth, elevation, duration / seconds)


def best_frame(run: FilmedRun, shot: Shot, stage: ReplayScene) -> int:
    """Return the index of the frame, after the first motion, in which the subjects of the run are seen best."""
    begun = [i for i, now in enumerate(shot.snapshots) if _moved(shot.snapshots[0], now, run.subjects)] or [0]
    candidates = sorted({begun[round(k)] for k in np.linspace(0, len(begun) - 1, 2 * KEY_MOMENTS)})

    def score(index: int) -> float:
        stage.set(shot.snapshots[index])
        return _clearness(stage.seen(shot.view(index), run.subjects), 1.5)

    best: int = max(candidates, key=score)
    return best


def _clearness(shares: tuple[float, float], most: float) -> float:
    return sum(min(share / enough, most) for share, enough in zip(shares, ENOUGH, strict=True))


def _moved(before: RobotSnapshot, now: RobotSnapshot, subjects: tuple[str, ...]) -> bool:
    """Return whether any of them is 3 cm or 2 degrees from where it was."""
    for name in subjects:
        was, is_now = before.body_poses[name], now.body_poses[name]
        turned = 2.0 * math.acos(min(1.0, abs(float(was.quaternion @ is_now.quaternion))))
        if np.linalg.norm(is_now.position - was.position) > 0.03 or turned > math.radians(2.0):
            return True
    return False


class ReplayScene:
    """A context manager that holds its own connection."""

    def __init__(self, run: FilmedRun) -> None:
        simulated: type[SimulatedRobot] = DRIVERS.resolve(DEFAULT_SIMULATOR)
        self._robot = simulated(run.robot_model, run.world, seed=run.config.seed)
        gripper = next(iter(run.robot_model.of(GripperModel).values()), None)
        self._hand = run.robot_model.base_frame if gripper is None else gripper.hand_link
        self._shown = (self._hand,) if gripper is None else (*gripper.part.finger_links, gripper.hand_link)
        self._doors = {
            f"{p.name}/{door.name}": (p, door) for p in run.world.furniture for door in p.model.articulations
        }
        self._starts = {walker.name: walker.route[0] for walker in run.world.walkers}

    def __enter__(self) -> ReplayScene:
        self._robot.connect()
        self._reader = self._robot.simulation.reader(ReadPurpose.RECORDING)
        return self

    def __exit__(self, *_: object) -> None:
        self._robot.disconnect()

    def set(self, snapshot: RobotSnapshot) -> None:
        """Set the poses of a snapshot. Raises FilmError if the robot has changed since the run."""
        simulation = self._robot.simulation
        engine, built = simulation.engine, simulation.built
        for name, pose in snapshot.body_poses.items():
            if name in self._doors:
                engine.set_joint(*built.articulations[name], opening(*self._doors[name], pose))
            elif name in self._starts:
                body, slides = built.walkers[name]
                for slide, value in zip(slides, pose.position[:2] - np.array(self._starts[name]), strict=True):
                    engine.set_joint(body, slide, float(value))
            else:
                body = built.objects[name]
                engine.put(body, pose.position.tolist(), pose.quaternion.tolist())
        now = simulation.link_pose(self._reader, simulation.model.base_frame)
        position, quaternion = self._reader.body_pose(built.robot)
        root = snapshot.map_from_base @ now.inverse() @ Pose(np.array(position), np.array(quaternion))
        engine.put(built.robot, root.position.tolist(), root.quaternion.tolist())
        unknown = set(snapshot.joint_positions) - set(built.joints)
        if unknown:
            raise FilmError(f"the robot has changed since the run: it has no joint {', '.join(sorted(unknown))}")
        for name, value in snapshot.joint_positions.items():
            engine.set_joint(built.robot, built.joints[name], value)

    def hand(self) -> NDArray[np.float64]:
        """Return the position of the hand, or of the base of a robot without one, (3,) metres."""
        return self._robot.simulation.link_pose(self._reader, self._hand).position

    def seen(
        self, viewpoint: Viewpoint, subjects: Sequence[str], width: int = 160, height: int = 120
    ) -> tuple[float, float]:
        """Return the fractions of an image that show the fingers and ``subjects`` (objects, doors or drawers)."""
        built = self._robot.simulation.built
        bodies, links = self._reader.segments(viewpoint, width, height)
        hand = [built.links[link] for link in self._shown if link in built.links]
        of_hand = (bodies == built.robot) & np.isin(links, hand)
        of_subjects = np.zeros_like(of_hand)
        for name in subjects:
            if name in built.objects:
                of_subjects |= bodies == built.objects[name]
            elif name in built.articulations:
                body, link = built.articulations[name]
                of_subjects |= (bodies == body) & (links == link)
        return float(np.mean(of_hand)), float(np.mean(of_subjects))

    def picture(self, viewpoint: Viewpoint, width: int, height: int, oversampling: int = 1) -> NDArray[np.uint8]:
        """Render the scene: (height, width, 3) uint8."""
        return smooth(self._reader.photo(viewpoint, width * oversampling, height * oversampling), oversampling)


def opening(furniture: PlacedFurniture, door: Articulation, map_from_articulation: Pose) -> float:
    """Return the opening of a door or drawer, radians or metres, for the frame at its joint."""
    closed = furniture.pose @ Pose(np.array(door.origin))
    moved = closed.inverse() @ map_from_articulation
    axis = np.asarray(door.axis)
    if door.kind == "prismatic":
        return float(moved.position @ axis)
    return wrap_angle(2.0 * math.atan2(float(moved.quaternion[:3] @ axis), float(moved.quaternion[3])))
