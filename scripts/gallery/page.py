"""The page of the gallery, from what is known of each film."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any


def page(known: Mapping[str, Mapping[str, Any]], folder: str) -> str:
    """Markdown text; ``folder``: of the films, beside the page."""
    return "\n".join(_lines(known, folder)) + "\n"


def _lines(known: Mapping[str, Mapping[str, Any]], folder: str) -> Iterator[str]:
    yield "# Gallery"
    yield ""
    yield "One judged run of each task, filmed by the simulator's renderer after the run had ended, and speeded up."
    yield "Made by `make gallery`; [evaluations](evaluation.md) measure how often each task succeeds."
    for task, facts in known.items():
        yield ""
        yield f"## {task}"
        yield ""
        yield facts["description"]
        yield ""
        if "failed" in facts:
            yield f"No film: {facts['failed']}"
            continue
        yield f'<video controls muted preload="none" poster="{folder}/{task}.jpg" width="560">'
        yield f'<source src="{folder}/{task}.mp4" type="video/mp4"></video>'
        yield ""
        metrics = "".join(f", {name} {value:g}" for name, value in facts["metrics"].items())
        yield (
            f"Seed {facts['seed']}: {facts['sim_time_s']:.0f} s, shown {facts['speed']:g} × as fast{metrics}, deepest "
            f"contact {facts['max_penetration_mm']:.2f} mm."
        )
