"""What a row of grasps comes to: rates with intervals, causes of failures, honesty."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from benchmarks.perception_measures.grasp_episodes import GraspEpisode
from bestman_bt.evaluation.interval import wilson_interval


def rate(hits: int, tries: int) -> tuple[float | None, list[float]]:
    """A share, None without tries, and its 95 % Wilson interval."""
    low, high = wilson_interval(hits, tries)
    return (round(hits / tries, 4) if tries else None), [round(low, 4), round(high, 4)]


def grasp_figures(episodes: Sequence[GraspEpisode], key: str, suffix: str = "") -> dict[str, object]:
    """Figures whose names begin with ``key``; ``<key>_rate<suffix>`` is the share of first attempts that held."""
    tries = len(episodes)
    first, interval = rate(sum(not episode.why for episode in episodes), tries)
    second, _ = rate(sum(not (episode.why and episode.second_why) for episode in episodes), tries)
    targets = sorted({episode.things[0] for episode in episodes})
    simulated, spent = (sum(getattr(e, name) for e in episodes) for name in ("simulated_seconds", "seconds"))
    failures = [
        {"seed": e.seed, "target": e.things[0], "why": e.why, "second_attempt": e.second_why or "held", **e.notes}
        for e in episodes
        if e.why
    ]
    return {
        f"{key}_rate{suffix}": first,
        f"{key}_rate{suffix}_interval": interval,
        f"{key}_rate{suffix}_with_retry": second,
        f"{key}_attempts{suffix}": tries,
        f"{key}_causes{suffix}": dict(Counter(episode.why for episode in episodes if episode.why).most_common()),
        f"{key}_by_target{suffix}": {name: _share(episodes, name) for name in targets} if len(targets) < 20 else {},
        f"{key}_touched_others{suffix}": sum(bool(episode.contacts) for episode in episodes),
        f"{key}_touched{suffix}": dict(Counter(name for e in episodes for name in e.contacts).most_common()),
        f"{key}_slip_mm_p90{suffix}": _percentile([1e3 * e.slip for e in episodes if not e.why], 90.0),
        f"{key}_cheats{suffix}": sum(episode.cheats for episode in episodes),
        f"{key}_real_time_factor{suffix}": round(simulated / spent, 2) if spent else None,
        f"{key}_failures{suffix}": failures,
    }


def _share(episodes: Sequence[GraspEpisode], target: str) -> str:
    mine = [episode for episode in episodes if episode.things[0] == target]
    return f"{sum(not episode.why for episode in mine)}/{len(mine)}"


def _percentile(values: list[float], share: float) -> float | None:
    return round(float(np.percentile(values, share)), 2) if values else None
