"""How many episodes a precision asks for: from the results in their order alone, with an interval that holds."""

from __future__ import annotations

from collections import Counter
from itertools import product

import pytest
from scipy.stats import binom

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.evaluation.interval import Precision, wilson_interval


@pytest.mark.parametrize("text", ["95%±3", "95 % ± 3 %", "95%+-3", "95+/-3.0"])
def test_a_precision_is_read(text: str) -> None:
    assert Precision.parse(text) == Precision(0.03)
    assert str(Precision.parse(text)) == "95%±3"


@pytest.mark.parametrize("text", ["3", "90%±3", "95%±0", "95%±60", "95%", ""])
def test_what_is_none_is_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match=r"--until: should be 95%±N with N from 0.5 to 50"):
        Precision.parse(text)


@pytest.mark.parametrize("points", [3, 5, 10])
@pytest.mark.parametrize("every", [1, 2, 7, 20])
def test_it_ends_where_the_interval_is_narrow_enough_and_not_a_round_earlier(points: int, every: int) -> None:
    """Each ``every``-th episode fails; one: all succeed."""
    precision = Precision(points / 100)
    rounds = [0]
    while (asked := precision.episodes([every == 1 or i % every != 0 for i in range(rounds[-1])], 5000)) > rounds[-1]:
        rounds.append(asked)
    for end in rounds[1:]:
        low, high = wilson_interval(sum(every == 1 or i % every != 0 for i in range(end)), end)
        assert (high - low <= 2 * precision.half_width + 1e-6) == (end == rounds[-1])
    if every == 1:
        assert len(rounds) == 2


def test_results_beyond_the_end_do_not_matter_and_the_most_is_kept() -> None:
    precision = Precision(0.05)
    enough = precision.episodes([], 1000)
    assert precision.episodes([True] * enough + [False] * 500, 1000) == enough
    assert precision.episodes([True, False] * 10, 20) == 20
    assert precision.episodes([], 20) == 20


@pytest.mark.slow
@pytest.mark.parametrize(("points", "rate"), list(product((5, 10), (0.5, 0.8, 0.9, 0.98))))
def test_the_interval_still_holds_the_rate_although_its_width_ended_the_episodes(points: int, rate: float) -> None:
    """All ways that the rounds can go, with their probabilities."""
    assert covered(Precision(points / 100), rate) > 0.92


def covered(precision: Precision, rate: float) -> float:
    chances, holds = {(0, 0): 1.0}, 0.0
    while chances:
        later: Counter[tuple[int, int]] = Counter()
        for (trials, successes), chance in chances.items():
            wanted = precision.enough(successes, trials)
            if trials and wanted == trials:
                low, high = wilson_interval(successes, trials)
                holds += chance * (low <= rate <= high)
                continue
            for more, share in enumerate(binom.pmf(range(wanted - trials + 1), wanted - trials, rate)):
                if chance * share > 1e-8:
                    later[wanted, successes + more] += chance * share
        chances = dict(later)
    return holds
