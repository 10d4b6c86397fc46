"""Make the README's animation: a finished run from outside, and beside it the main tree with the states of its nodes.

    python scripts/tree_animation.py runs/<run> [--out docs/images/fetch_from_drawer.webp] [--seconds 14]

The run is of a simulated robot. Only the main tree is drawn; of a subtree that runs, the leaf that runs in it. About a
minute of processor time.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from bestman_bt.evaluation.film.filmed_run import read_filmed_run
from bestman_bt.evaluation.film.shot import plan_shot
from bestman_bt.evaluation.film.stage import Stage
from bestman_bt.records.history import RunHistory
from bestman_bt.records.reader import read
from bestman_bt.records.states import NO, NodeStates

RATE = 8
"""Frames per second."""
PICTURE = (520, 390)
PANEL = 400
LARGEST = 3_000_000
COLOURS = {IDLE: (150, 158, 166), RUNNING: (52, 120, 246), SUCCESS: (34, 150, 84), FAILURE: (176, 124, 40)}
"""Text and marks of a node by state; a failed node is brown, since most failures are a condition's ordinary answer."""
MARKS = {IDLE: "·", RUNNING: "▸", SUCCESS: "✓", FAILURE: "✗"}
BACKGROUND = (250, 251, 252)
FONTS = Path("/usr/share/fonts/truetype/dejavu")


def main() -> None:
    """Read the run, draw each frame, write the animation."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    images = Path(__file__).resolve().parents[1] / "docs" / "images"
    parser.add_argument("--out", type=Path, default=images / "fetch_from_drawer.webp")
    parser.add_argument("--seconds", type=float, default=14.0)
    options = parser.parse_args()
    run = read_filmed_run(options.run)
    history = read(options.run)
    times = np.linspace(0.0, run.motion.duration, round(options.seconds * RATE))
    frames = []
    with Stage(run) as stage:
        shot = plan_shot(run, stage)
        for time in times:
            stage.set(run.motion.at(float(time)))
            picture = stage.picture(shot.view_at(float(time)), *PICTURE, oversampling=2)
            frames.append(_frame(picture, history, float(time)))
    still = [round(1000 / RATE)] * (len(frames) - 1) + [2500]
    for quality in (60, 50, 40, 30, 20):
        frames[0].save(options.out, save_all=True, append_images=frames[1:], duration=still, loop=0, quality=quality)
        if options.out.stat().st_size <= LARGEST:
            break
    print(f"{options.out}: {len(frames)} frames, {options.out.stat().st_size / 1e6:.1f} MB")


def _frame(picture: np.ndarray, history: RunHistory, time: float) -> Image.Image:
    frame = Image.new("RGB", (PICTURE[0] + PANEL, PICTURE[1]), BACKGROUND)
    frame.paste(Image.fromarray(picture), (0, 0))
    draw = ImageDraw.Draw(frame)
    top, left = 12, PICTURE[0] + 14
    draw.text((frame.width - 62, PICTURE[1] - 24), f"{time:5.1f} s", font=_font(13), fill=(110, 118, 126))
    for depth, text, state in _rows(history, history.states.at(time).nodes):
        colour = COLOURS[state]
        x = left + 15 * depth
        draw.text((x, top), MARKS[state], font=_font(14, bold=True), fill=colour)
        draw.text((x + 15, top), text, font=_font(14, bold=state == RUNNING), fill=colour)
        top += 22
    return frame


def _rows(history: RunHistory, now: NodeStates) -> list[tuple[int, str, int]]:
    """Depth, text and state of each row: the nodes of the main tree and the leaf that runs in a subtree.

    A node that is idle again keeps its last result.
    """
    nodes = history.nodes
    rows: list[tuple[int, str, int]] = []
    subtree = [0]  # the outermost SubTree that each node is in, by uid
    for node in nodes:
        above = subtree[node.parent] if node.parent is not None else 0
        subtree.append(above or (node.uid if node.category == "subtree" else 0))
        if above:
            continue
        depth, state = nodes.depth(node.uid), int(now.states[node.uid] or now.results[node.uid])
        rows.append((depth, node.name or node.type, state))
        if node.category == "subtree" and state == RUNNING:
            inside = nodes[node.uid :]
            running = [leaf for leaf in inside if leaf.is_leaf and now.states[leaf.uid] == RUNNING]
            rows += [(depth + 1, leaf.type, RUNNING) for leaf in running[:1]]
    return rows


def _font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(str(FONTS / ("DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf")), size)


if __name__ == "__main__":
    main()
