"""The openpi client against a server in its own process that speaks the real format."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import msgpack
import numpy as np
import pytest

from bestman_bt.manipulation.policy.base import Observation
from bestman_bt.manipulation.policy.errors import (
    PolicyActionError,
    PolicyError,
    PolicyModelError,
    PolicyObservationError,
    PolicyServerError,
    PolicyUnreachableError,
)
from bestman_bt.manipulation.policy.openpi_client import OpenpiPolicy, pack, resize_with_pad, unpack
from bestman_bt.manipulation.policy.policy_file import load_policy
from bestman_bt.manipulation.policy.specification import ActionSpace
from bestman_bt.messages import Pose

JOINTS = tuple(f"panda_joint{i}" for i in range(1, 8))
SERVER = OpenpiPolicy(
    joint_names=JOINTS,
    prompt="reach the red cup",
    connect_timeout=5.0,
    timeout=5.0,
    image_keys={"head": "observation/exterior_image_1_left"},
)


def observation() -> Observation:
    image = np.full((48, 64, 3), 90, dtype=np.uint8)
    return Observation(np.linspace(0.1, 0.7, 7), Pose(), gripper_width=0.06, images={"head": image})


@pytest.fixture
def serve() -> Iterator[Callable[[str], OpenpiPolicy]]:
    servers: list[subprocess.Popen[str]] = []

    def start(mode: str) -> OpenpiPolicy:
        command = [sys.executable, str(Path(__file__).with_name("openpi_server.py")), mode]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        servers.append(server)
        assert server.stdout is not None
        return replace(SERVER, url=f"ws://127.0.0.1:{int(server.stdout.readline())}")

    yield start
    for server in servers:
        server.kill()
        server.communicate()


def test_an_observation_goes_out_and_actions_come_back(serve: Callable[[str], OpenpiPolicy]) -> None:
    policy = serve("good")
    assert policy.metadata() == {"model": "tiny", "mode": "good"}
    policy.reset()
    chunk = policy.act(observation())
    policy.close()
    assert chunk.space is ActionSpace.JOINT_POSITIONS
    assert chunk.dt == pytest.approx(1 / 15)
    expected = np.tile(np.linspace(0.1, 0.7, 7), (16, 1))
    expected[:, 0] += np.arange(16) * 0.01
    np.testing.assert_allclose(chunk.actions, expected, atol=1e-6)
    np.testing.assert_allclose(chunk.gripper_widths, 0.06, atol=1e-6)


def test_widths_go_out_and_come_back_between_closed_and_open(serve: Callable[[str], OpenpiPolicy]) -> None:
    """A hand that is open a little farther than it should be, or closed a little more, is open or closed."""
    policy = serve("good")
    for width, told in ((0.1, 0.08), (-0.01, 0.0), (0.02, 0.02)):
        chunk = policy.act(replace(observation(), gripper_width=width))
        np.testing.assert_allclose(chunk.gripper_widths, told, atol=1e-6)
    policy.close()


@pytest.mark.parametrize(
    ("shape", "rows", "columns"), [((48, 64), (28, 196), (0, 224)), ((64, 48), (0, 224), (28, 196))]
)
def test_pictures_keep_their_form_and_lie_in_the_middle_of_black(
    shape: tuple[int, int], rows: tuple[int, int], columns: tuple[int, int]
) -> None:
    padded = resize_with_pad(np.full((*shape, 3), 90, dtype=np.uint8), (224, 224))
    filled = np.zeros((224, 224, 3), dtype=np.uint8)
    filled[slice(*rows), slice(*columns)] = 90
    np.testing.assert_array_equal(padded, filled)


@pytest.mark.parametrize("dtype", ["|O", "|V8", "<c16"])
def test_arrays_that_are_no_numbers_are_neither_sent_nor_accepted(dtype: str) -> None:
    told = {b"__ndarray__": True, b"data": b"\0" * 16, b"dtype": dtype, b"shape": (1,)}
    with pytest.raises(PolicyServerError, match="not msgpack with numpy arrays"):
        unpack(msgpack.packb(told))
    with pytest.raises(ValueError, match="cannot be sent"):
        pack(np.zeros(1, dtype=dtype))
    numbers = np.arange(6, dtype="<i2").reshape(2, 3)
    np.testing.assert_array_equal(unpack(pack({"a": numbers}))["a"], numbers)


def test_pictures_go_out_as_large_as_the_server_wants_them(serve: Callable[[str], OpenpiPolicy]) -> None:
    policy = serve("good")
    answer = policy.ask(pack(policy.question(observation())))
    policy.close()
    assert answer["state"] == {"image_shape": [224, 224, 3], "brightest": 90, "prompt": "reach the red cup"}


def test_a_lost_connection_is_made_anew(serve: Callable[[str], OpenpiPolicy]) -> None:
    policy = serve("one_each")
    chunks = [policy.act(observation()) for _ in range(3)]
    policy.close()
    assert all(np.array_equal(chunk.actions, chunks[0].actions) for chunk in chunks)


@pytest.mark.parametrize(
    ("mode", "error", "told"),
    [
        ("nan", PolicyActionError, "NaN"),
        ("narrow", PolicyActionError, "at least 8 columns but gives 5"),
        ("nothing", PolicyActionError, "'actions' of shape"),
        ("traceback", PolicyServerError, "KeyError: 'observation/state'"),
        ("garbage", PolicyServerError, "not msgpack"),
        ("no_metadata", PolicyServerError, "not msgpack"),
    ],
)
def test_an_answer_that_cannot_be_used_is_an_error_of_its_type(
    serve: Callable[[str], OpenpiPolicy], mode: str, error: type[PolicyError], told: str
) -> None:
    policy = serve(mode)
    with pytest.raises(error, match=told):
        policy.act(observation())
    policy.close()


def test_a_server_that_is_late_is_given_up_within_the_timeout(serve: Callable[[str], OpenpiPolicy]) -> None:
    policy = replace(serve("silent"), timeout=0.3, retries=1)
    start = time.monotonic()
    with pytest.raises(PolicyUnreachableError, match=r"in 2 tries; the last: no answer within 0\.3 s"):
        policy.act(observation())
    assert time.monotonic() - start < 20.0  # the server answers after 30 s


@pytest.mark.parametrize("url", ["ws://127.0.0.1:9", "no address"])
def test_where_there_is_no_server_that_is_said(url: str) -> None:
    with pytest.raises(PolicyUnreachableError, match=url):
        replace(SERVER, url=url).act(observation())


def test_a_camera_or_width_that_is_missing_is_refused_before_anything_is_sent() -> None:
    policy = replace(SERVER, url="ws://127.0.0.1:9")
    with pytest.raises(PolicyObservationError, match="camera 'head'"):
        policy.act(Observation(np.zeros(7), Pose(), gripper_width=0.06))
    with pytest.raises(PolicyObservationError, match="gripper's width"):
        policy.act(Observation(np.zeros(7), Pose()))


def test_the_key_of_a_server_is_not_shown() -> None:
    assert "s3cr3t" not in repr(OpenpiPolicy(url="ws://127.0.0.1:1", api_key="s3cr3t"))


def test_the_specification_can_be_read_without_a_server(tmp_path: Path) -> None:
    path = tmp_path / "server.yaml"
    path.write_text("url: ws://127.0.0.1:9\njoint_names: [a, b]\ngripper_column: null\nspace: joint_deltas\n")
    specification = load_policy(path).specification
    assert (specification.joint_names, specification.space) == (("a", "b"), "joint_deltas")
    assert not specification.moves_gripper


@pytest.mark.parametrize(
    ("field", "told"),
    [
        ("joint_name: [a, b]", "joint_name"),
        ("joint_names: panda", "should be a list, got .panda."),
        ("space: joints", "joint_deltas"),
        ("timeout: 0", "timeout of a policy server should be above 0"),
    ],
)
def test_a_server_that_is_described_wrongly_is_refused(tmp_path: Path, field: str, told: str) -> None:
    path = tmp_path / "server.yaml"
    path.write_text(f"url: ws://127.0.0.1:9\n{field}\n")
    nowhere = tmp_path / "nowhere.yaml"
    nowhere.write_text("joint_names: [a]\n")
    with pytest.raises(PolicyModelError, match="should have 'url'"):
        load_policy(nowhere)
    with pytest.raises(PolicyModelError, match=told):
        load_policy(path)
