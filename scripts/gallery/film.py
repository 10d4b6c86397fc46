"""From a track to a film and a still: a camera that follows the robot from the side on which most is seen."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import gaussian_filter1d
from stage import Stage, viewpoint
from track import Moment, Track

from hal.pybullet import Viewpoint

SIZE = (560, 420)
STILL_SIZE = (960, 720)
RATE = 12
"""Frames per second."""
SECONDS = (8.0, 13.0)
"""Shortest and longest film."""
AZIMUTHS = np.arange(12) * math.pi / 6
ELEVATIONS = (math.radians(25.0), math.radians(40.0))
DISTANCE = 2.3
ENOUGH = (0.004, 0.01)
"""Shares of the picture at which the hand and what it handles are seen well enough."""
KEY_MOMENTS = 10
LARGEST_FILM = 1_500_000
LARGEST_STILL = 200_000


@dataclass(frozen=True)
class Shot:
    """``moments``: one per frame; ``targets``: (N, 3) what the camera looks at; ``speed``: times as fast as it was."""

    moments: tuple[Moment, ...]
    targets: NDArray[np.float64]
    azimuth: float
    elevation: float
    speed: float

    def view(self, index: int) -> Viewpoint:
        """Of one frame."""
        return viewpoint(self.targets[index], self.azimuth, self.elevation, DISTANCE)


def subjects(track: Track) -> list[str]:
    """What the task is about: objects, doors and drawers."""
    task = track.setup.config.task
    named = [goal.object for goal in track.setup.goals]
    named += [task.opening.articulation] if task.opening is not None else []
    return named + (list(task.tidy.objects) if task.tidy is not None else [])


def plan_shot(track: Track, stage: Stage) -> Shot:
    """Choose the frames, let the camera follow, choose the side."""
    seconds = min(max(track.duration / 4.0, SECONDS[0]), SECONDS[1])
    count = round(seconds * RATE)
    chosen = np.linspace(0, len(track.moments) - 1, count).round().astype(int)
    moments = tuple(track.moments[i] for i in chosen)
    hands = []
    for moment in moments:
        stage.set(moment)
        hands.append(stage.hand())
    bases = np.array([moment.snapshot.base_pose.position for moment in moments])
    middle = 0.35 * bases + 0.65 * np.array(hands)
    middle[:, 2] = 0.75
    targets = gaussian_filter1d(middle, sigma=0.8 * RATE, axis=0, mode="nearest")
    best = max(
        ((float(azimuth), elevation) for azimuth in AZIMUTHS for elevation in ELEVATIONS),
        key=lambda side: _score(track, stage, moments, targets, bases, *side),
    )
    return Shot(moments, targets, *best, track.duration / seconds)


def _score(
    track: Track,
    stage: Stage,
    moments: tuple[Moment, ...],
    targets: NDArray[np.float64],
    bases: NDArray[np.float64],
    azimuth: float,
    elevation: float,
) -> float:
    """How well hand and subjects are seen while the base stands."""
    moved = np.linalg.norm(np.gradient(bases, axis=0), axis=1)
    standing = np.flatnonzero(moved < 1e-3)
    keys = standing[np.linspace(0, len(standing) - 1, KEY_MOMENTS).round().astype(int)]
    score = 0.0
    for index in keys:
        stage.set(moments[index])
        shares = stage.seen(viewpoint(targets[index], azimuth, elevation, DISTANCE), subjects(track))
        score += sum(min(share / enough, 1.0) for share, enough in zip(shares, ENOUGH, strict=True))
    return score


def frames(track: Track, shot: Shot, stage: Stage) -> Iterator[NDArray[np.uint8]]:
    """All frames, with a line that tells what is going on."""
    for index, moment in enumerate(shot.moments):
        stage.set(moment)
        picture = stage.picture(shot.view(index), *SIZE)
        passed = moment.snapshot.stamp - shot.moments[0].snapshot.stamp
        yield captioned(picture, f"{track.setup.config.name}   {passed:5.1f} s   {shot.speed:.0f} x   {moment.doing}")


def captioned(picture: NDArray[np.uint8], text: str) -> NDArray[np.uint8]:
    """With a line of text at the lower edge."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image, "RGBA")
    draw.rectangle((0, image.height - 24, image.width, image.height), fill=(20, 24, 28, 170))
    draw.text((10, image.height - 20), text, font=ImageFont.load_default(14), fill=(255, 255, 255, 255))
    return np.asarray(image)


def write_still(track: Track, shot: Shot, stage: Stage, path: Path) -> None:
    """The frame in which most is seen of what the hand does, once that has begun to move."""
    there = subjects(track)
    begun = [i for i, moment in enumerate(shot.moments) if _moved(shot.moments[0], moment, there)] or [0]
    candidates = sorted({begun[round(k)] for k in np.linspace(0, len(begun) - 1, 2 * KEY_MOMENTS)})

    def score(index: int) -> float:
        stage.set(shot.moments[index])
        shares = stage.seen(shot.view(index), there)
        return sum(min(share / enough, 1.5) for share, enough in zip(shares, ENOUGH, strict=True))

    index = max(candidates, key=score)
    stage.set(shot.moments[index])
    image = Image.fromarray(stage.picture(shot.view(index), *STILL_SIZE, oversampling=2))
    for quality in (88, 80, 70, 60):
        image.save(path, quality=quality, optimize=True)
        if path.stat().st_size <= LARGEST_STILL:
            return


def _moved(before: Moment, now: Moment, subjects: list[str]) -> bool:
    for name in subjects:
        if name in now.openings and abs(now.openings[name] - before.openings[name]) > 0.03:
            return True
        poses = now.snapshot.object_poses
        if name in poses and np.linalg.norm(poses[name].position - before.snapshot.object_poses[name].position) > 0.03:
            return True
    return False


def write_film(pictures: list[NDArray[np.uint8]], path: Path) -> None:
    """An mp4 (H.264) of at most LARGEST_FILM bytes; RuntimeError where its writer is not installed."""
    try:
        import av
    except ImportError as error:
        raise RuntimeError("films need PyAV: pip install 'bestman-bt[gallery]'") from error
    height, width = pictures[0].shape[:2]
    for quality in (25, 29, 33, 37):
        with av.open(str(path), "w", options={"movflags": "faststart"}) as out:
            stream = out.add_stream("libx264", rate=RATE, options={"crf": str(quality), "preset": "slow"})
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            for picture in pictures:
                out.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
            out.mux(stream.encode())
        if path.stat().st_size <= LARGEST_FILM:
            return
