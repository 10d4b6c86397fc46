from __future__ import annotations

from collections.abc import Callable

import pytest

from benchmarks.rendered_table import RenderedTable, random_table
from bestman_bt.errors import MissingExtraError
from bestman_bt.extras import open3d


@pytest.fixture(scope="session")
def needs_open3d() -> None:
    """Skips the test where the extra, or a system library that its wheel loads, is not installed."""
    try:
        open3d()
    except MissingExtraError as missing:
        pytest.skip(str(missing))


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
