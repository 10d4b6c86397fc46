"""How many examples each property is tried with: few in every test run, many by ``make properties``."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from hypothesis import HealthCheck, Phase, settings

FACTOR = int(os.environ.get("PROPERTY_EXAMPLES", "1"))


def examples(count: int) -> Callable[[Any], Any]:
    """``count`` examples, always the same, not shrunk where one fails.

    With ``PROPERTY_EXAMPLES=N`` N times as many, others each time, and shrunk.
    """
    return settings(
        max_examples=count * FACTOR,
        derandomize=FACTOR == 1,
        database=None,
        deadline=None,
        phases=[phase for phase in Phase if phase is not Phase.explain and (FACTOR > 1 or phase is not Phase.shrink)],
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
    )
