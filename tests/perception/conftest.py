from __future__ import annotations

from collections.abc import Callable

import pytest

from benchmarks.rendered_table import RenderedTable, random_table


@pytest.fixture(scope="session")
def table() -> Callable[..., RenderedTable]:
    """Rendered scenes by seed, each drawn once per session."""
    drawn: dict[tuple[object, ...], RenderedTable] = {}

    def draw(seed: int, **options: object) -> RenderedTable:
        key = (seed, *sorted(options.items()))
        if key not in drawn:
            drawn[key] = random_table(seed, **options)  # type: ignore[arg-type]
        return drawn[key]

    return draw
