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

from bestman_bt.engine.status import RUNNING
from bestman_bt.evaluation.film.filmed_run import read_filmed_run
from bestman_bt.evaluation.film.rendering import ReplayScene, plan_shot
from bestman_bt.records.history import RunHistory
from bestman_bt.records.palette import LOOKS
from bestman_bt.records.reader import read
from bestman_bt.records.states import NodeStates

RATE = 8
"""Frames per second."""
PICTURE = (520, 390)
PANEL = 400
LARGEST = 3_000_000
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
    with ReplayScene(run) as stage:
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
        look = LOOKS[state]
        x = left + 15 * depth
        draw.text((x, top), look.icon, font=_font(14, bold=True), fill=look.light)
        draw.text((x + 15, top), text, font=_font(14, bold=state == RUNNING), fill=look.light)
        top += 22
    return frame


def _rows(history: RunHistory, now: NodeStates) -> list[tuple[int, str, int]]:
    """Depth, text and state of each row: the nodes of the main tree and the leaf that runs in a subtree.

    A node that is idle again keeps its last result.
    """
    nodes = history.nodes
    outermost = [0]  # SubTree that each node is in, by uid
    for node in nodes:
        above = outermost[node.parent] if node.parent is not None else 0
        parent_is_subtree = node.parent is not None and nodes.node(node.parent).category == "subtree"
        outermost.append(above or (node.parent or 0) * parent_is_subtree)
    rows: list[tuple[int, str, int]] = []
    for node in nodes:
        if outermost[node.uid]:
            continue
        depth, state = nodes.depth(node.uid), int(now.states[node.uid] or now.results[node.uid])
        rows.append((depth, node.name or node.type, state))
        if node.category == "subtree" and state == RUNNING:
            inside = [leaf for leaf in nodes if leaf.is_leaf and outermost[leaf.uid] == node.uid]
            rows += [(depth + 1, leaf.type, RUNNING) for leaf in inside if now.states[leaf.uid] == RUNNING][:1]
    return rows


def _font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(str(FONTS / ("DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf")), size)


if __name__ == "__main__":
    main()
