"""Chunks as one motion: within the limits, without a stop where one chunk meets the next, at rest where they end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from bestman_bt.manipulation.policy.chunk_stream import ChunkStream, StreamedMotion
from bestman_bt.manipulation.policy.errors import PolicyActionError, StaleChunkError
from bestman_bt.manipulation.policy.training.reaching import ReachingExpert
from bestman_bt.messages import JointTrajectory
from tests.rigs.limit_usage import limit_usage

DT, HORIZON, EXECUTED = 0.08, 10, 5
LATENCY = 0.12
FAST, HARD = 0.5, 0.35


@dataclass
class Streamed:
    """What was followed: positions, velocities and accelerations each 5 ms, and all motions that were accepted."""

    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    accelerations: NDArray[np.float64]
    motions: list[JointTrajectory]
    stream: ChunkStream


def chunk_along(line: NDArray[np.float64], rate: float, noise: float, rng: np.random.Generator):
    """What a policy says that moves along ``line`` (7,) at ``rate`` per second, each time a little differently."""

    def answer(now: float, start: NDArray[np.float64]) -> NDArray[np.float64]:
        steps = rate * DT * np.arange(HORIZON + 1)[:, None] * line
        return start + steps + rng.normal(0.0, noise, 7) * np.minimum(np.arange(HORIZON + 1), 3)[:, None]

    return answer


def streamed(expert: ReachingExpert, answer, chunks: int = 6, latency: float = LATENCY) -> Streamed:
    stream, now, start, motions = ChunkStream(expert.arm), 0.0, expert.home, []
    sampled = []
    for _ in range(chunks):
        if stream.motion is not None:
            start = stream.motion.state(now).positions
        spliced = stream.splice(answer(now, start), DT, now, now + latency)
        motions.append(stream.accept(spliced, now + 0.5 * latency))
        sampled.extend(
            stream.motion.state(float(time)) for time in np.arange(now, now + EXECUTED * DT, 0.005) + 0.5 * latency
        )
        now += EXECUTED * DT
    columns = zip(*((s.positions, s.velocities, s.accelerations) for s in sampled), strict=True)
    return Streamed(*(np.array(column) for column in columns), motions, stream)


@pytest.fixture(scope="module")
def line(expert: ReachingExpert) -> NDArray[np.float64]:
    return np.array([1.0, 0.5, -0.5, -0.4, 0.2, 0.6, 0.8]) * 0.3


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.1])
def test_velocity_acceleration_and_jerk_keep_their_limits_whatever_the_chunks_say(
    expert: ReachingExpert, line: NDArray[np.float64], noise: float
) -> None:
    result = streamed(expert, chunk_along(line, 1.0, noise, np.random.default_rng(1)))
    for motion in result.motions:
        usage = limit_usage(motion, expert.arm, jerk=result.stream.jerk_limits)
        assert usage.velocity <= FAST * 1.03
        assert usage.acceleration <= HARD * 1.03
        assert usage.jerk is not None
        assert usage.jerk <= 1.03
        assert usage.position == 0.0


def test_the_motion_does_not_stop_where_chunks_meet(expert: ReachingExpert, line: NDArray[np.float64]) -> None:
    """After the first chunk has gathered speed it keeps it: the slowest moment is 0.9 of what is asked."""
    result = streamed(expert, chunk_along(line, 1.0, 0.0, np.random.default_rng(1)))
    along = result.velocities @ line / (line @ line)
    assert along[100:].min() > 0.9
    assert along[100:].max() < 1.1


def test_chunks_that_disagree_leave_no_jumps(expert: ReachingExpert, line: NDArray[np.float64]) -> None:
    result = streamed(expert, chunk_along(line, 1.0, 0.01, np.random.default_rng(2)))
    along = result.velocities @ line / (line @ line)
    assert along[100:].min() > 0.3
    steps = np.abs(np.diff(result.accelerations, axis=0)).max(axis=0)
    assert (steps <= 1.03 * 0.005 * result.stream.jerk_limits + 0.021 * result.stream.jerk_limits).all()
    assert (np.abs(np.diff(result.positions, axis=0)) <= FAST * 1.03 * 0.005 * expert.arm.velocity).all()


def test_between_two_chunks_the_older_ones_weight_falls_from_one_to_nothing(expert: ReachingExpert) -> None:
    aside = 0.05 * np.ones(7)
    stream = ChunkStream(expert.arm, blend=0.3)
    still = np.tile(expert.home, (HORIZON + 1, 1))
    slow = still + 0.01 * np.arange(HORIZON + 1)[:, None] * np.ones(7)
    stream.accept(stream.splice(slow, DT, 0.0, 0.0), 0.0)
    old = stream.motion
    assert old is not None
    joined = stream.splice(slow + aside, DT, 0.0, 0.2)
    np.testing.assert_allclose(joined.state(0.2).positions, old.state(0.2).positions)
    np.testing.assert_allclose(joined.state(0.2).velocities, old.state(0.2).velocities)
    for time, share in ((0.32, 0.352), (0.4, 0.7407), (0.48, 0.9873), (0.56, 1.0)):
        apart = joined.intended.sample(time - joined.said)[0] - old.intended.sample(time - old.said)[0]
        np.testing.assert_allclose(apart, share * aside, atol=1e-4, err_msg=str(time))
    gap = joined.state(0.32).positions - old.state(0.32).positions
    assert (gap > 0.0).all()
    assert (gap < 0.5 * aside).all()
    np.testing.assert_allclose(joined.state(joined.end).positions, slow[-1] + aside, atol=1e-6)


def test_an_arm_whose_policy_falls_silent_comes_to_rest_where_the_last_chunk_ends(
    expert: ReachingExpert, line: NDArray[np.float64]
) -> None:
    result = streamed(expert, chunk_along(line, 1.0, 0.0, np.random.default_rng(1)), chunks=3)
    motion = result.stream.motion
    assert motion is not None
    end = motion.state(motion.end)
    np.testing.assert_allclose(end.velocities, 0.0, atol=1e-9)
    np.testing.assert_allclose(end.accelerations, 0.0, atol=1e-9)
    assert not result.stream.moving(motion.end)


def test_a_hasty_chunk_is_slowed_and_a_jump_is_no_motion(expert: ReachingExpert) -> None:
    stream = ChunkStream(expert.arm)
    ramp = np.clip(expert.home + 0.1 * np.arange(HORIZON + 1)[:, None], expert.arm.lower, expert.arm.upper)
    motion = stream.splice(ramp, 0.02, 0.0, 0.0)
    assert motion.trajectory.duration > 2 * 0.02 * HORIZON
    np.testing.assert_allclose(motion.trajectory.positions[-1], ramp[-1], atol=1e-6)
    with pytest.raises(PolicyActionError, match="jumps"):
        stream.splice(ramp, 1e-4, 0.0, 0.0)


def test_a_chunk_that_comes_too_late_is_stale(expert: ReachingExpert, line: NDArray[np.float64]) -> None:
    stream = ChunkStream(expert.arm)
    answer = chunk_along(line, 1.0, 0.0, np.random.default_rng(1))
    stream.accept(stream.splice(answer(0.0, expert.home), DT, 0.0, 0.0), 0.0)
    start = stream.motion.state(0.4).positions  # type: ignore[union-attr]
    with pytest.raises(StaleChunkError, match="over before it could begin"):
        stream.splice(answer(0.4, start), DT, 0.4, 1.3)
    spliced = stream.splice(answer(0.4, start), DT, 0.4, 0.5)
    before: StreamedMotion | None = stream.motion
    with pytest.raises(StaleChunkError, match="ago"):
        stream.accept(spliced, 0.6)
    assert stream.motion is before


def test_what_was_seen_at_rest_may_begin_whenever_it_is_ready(
    expert: ReachingExpert, line: NDArray[np.float64]
) -> None:
    stream = ChunkStream(expert.arm)
    answer = chunk_along(line, 1.0, 0.0, np.random.default_rng(1))
    spliced = stream.splice(answer(0.0, expert.home), DT, 0.0, 2.0)
    motion = stream.accept(spliced, 5.0)
    np.testing.assert_array_equal(motion.positions[0], expert.home)
    assert stream.motion is not None
    assert stream.motion.start == 5.0
