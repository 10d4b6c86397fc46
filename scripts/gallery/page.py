"""The page of the gallery, from the facts of each film."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any


def page(known: Mapping[str, Mapping[str, Any]], folder: str) -> str:
    """Return Markdown. ``known``: task → facts of its film. ``folder``: that of the films, relative to the page."""
    return "\n".join(_lines(known, folder)) + "\n"


def _lines(known: Mapping[str, Mapping[str, Any]], folder: str) -> Iterator[str]:
    yield "# Gallery"
    yield ""
    yield "One successful run of each task, rendered from its recording and played faster than real time."
    yield "`make gallery` makes the films; [evaluations](evaluation.md) measure success rates."
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
        results = [f"`{name}` {value + 0.0:g}" for name, value in facts["metrics"].items()]  # 0.0 for -0.0
        results.append(f"deepest contact {facts['max_penetration_mm']:.2f} mm.")
        yield (
            f"Seed {facts['seed']}, {facts['sim_time_s']:.0f} s of simulated time, played {facts['speed']:g} × as fast."
            f" Result: {', '.join(results)}"
        )
