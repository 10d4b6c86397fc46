"""Statistics of datasets: those of NumPy for an episode, and what follows from them for all frames."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bestman_bt.manipulation.policy.training.dataset_statistics import (
    QUANTILES,
    THINNED,
    PictureStatistics,
    combined,
    number_statistics,
)


def test_quantiles_of_numbers_are_of_each_entry() -> None:
    found = number_statistics(np.column_stack([np.arange(101), np.arange(0, -202, -2)]).astype(np.float32))
    assert {name: found[name] for name in QUANTILES} == {
        "q01": pytest.approx([1.0, -198.0]),
        "q10": pytest.approx([10.0, -180.0]),
        "q50": pytest.approx([50.0, -100.0]),
        "q90": pytest.approx([90.0, -20.0]),
        "q99": pytest.approx([99.0, -2.0]),
    }
    assert (found["min"], found["max"], found["count"]) == ([0.0, -200.0], [100.0, 0.0], [101])


def test_a_single_frame_has_its_value_as_every_quantile() -> None:
    found = number_statistics(np.array([3]))
    assert {name: found.pop(name) for name in ("std", "count")} == {"std": [0.0], "count": [1]}
    assert found == {name: [3.0] for name in ("min", "max", "mean", *QUANTILES)}


def test_pictures_have_the_statistics_of_their_thinned_pixels() -> None:
    rng = np.random.default_rng(5)
    pictures = rng.integers([10, 100, 200], [60, 101, 250], size=(3, 40, 64, 3), dtype=np.uint8)
    statistics = PictureStatistics()
    for picture in pictures:
        statistics.add(picture)
    found = statistics.to_dict()
    pixels = pictures[:, ::THINNED, ::THINNED].reshape(-1, 3) / 255.0
    assert found.pop("count") == [3]
    assert {np.shape(value) for value in found.values()} == {(3, 1, 1)}
    assert np.ravel(found["min"]) == pytest.approx(pixels.min(axis=0))
    assert np.ravel(found["max"]) == pytest.approx(pixels.max(axis=0))
    assert np.ravel(found["mean"]) == pytest.approx(pixels.mean(axis=0))
    assert np.ravel(found["std"]) == pytest.approx(pixels.std(axis=0))
    for name, quantile in QUANTILES.items():
        expected = np.quantile(pixels, quantile, axis=0, method="inverted_cdf")
        assert np.ravel(found[name]) == pytest.approx(expected)


def of_all(*episodes: dict[str, Any]) -> dict[str, Any]:
    total = None
    for one in episodes:
        total = combined(total, one)
    assert total is not None
    return total


def test_statistics_of_all_frames_follow_from_those_of_episodes_and_quantiles_are_bounds() -> None:
    rng = np.random.default_rng(7)
    episodes = [rng.normal(middle, 1.0, size=(length, 2)) for middle, length in ((0.0, 30), (4.0, 70), (-2.0, 50))]
    each, whole = [number_statistics(one) for one in episodes], number_statistics(np.concatenate(episodes))
    found = of_all(*each)
    for name in ("min", "max", "mean", "std", "count"):
        assert found[name] == pytest.approx(whole[name])
    assert found["q10"] == each[2]["q10"]
    assert found["q50"] == each[2]["q50"]
    assert found["q99"] == each[1]["q99"]
    assert np.all(np.array(found["q01"]) <= whole["q01"])
    assert np.all(np.array(found["q90"]) >= whole["q90"])


def test_quantiles_that_an_episode_lacks_are_left_out() -> None:
    whole = number_statistics(np.arange(5.0))
    lacks = {name: value for name, value in whole.items() if name not in QUANTILES} | {"q02": [0.0]}
    for episodes in ((whole, lacks), (lacks, whole), (lacks, lacks, whole)):
        assert set(of_all(*episodes)) == {"min", "max", "mean", "std", "count"}
