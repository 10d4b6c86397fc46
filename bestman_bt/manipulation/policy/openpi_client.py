"""Client for policies on another machine with openpi's protocol, such as π0.

A websocket; the server first sends its metadata, then answers each observation (a map) with a map that has ``actions``
(H, m); both in msgpack with numpy arrays. A text frame from the server is an error's traceback. As in the repository
Physical-Intelligence/openpi (``WebsocketPolicyServer``).
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.errors import Error, MissingExtraError
from bestman_bt.extras import install_command
from bestman_bt.manipulation.policy.base import ActionChunk, Observation, Policy
from bestman_bt.manipulation.policy.errors import (
    PolicyActionError,
    PolicyModelError,
    PolicyObservationError,
    PolicyServerError,
    PolicyUnreachableError,
)
from bestman_bt.manipulation.policy.specification import ActionSpace, PolicySpecification

# Numpy arrays in msgpack, as openpi's servers and clients write them.
# An array is a map with the *byte string* keys ``__ndarray__``, ``data``, ``dtype`` (as ``<f4``) and ``shape``; a numpy
# scalar one with ``__npgeneric__``, ``data`` and ``dtype``.


_BROKEN = (ValueError, TypeError, KeyError, OverflowError, SyntaxError)
"""Errors caused by invalid bytes, besides msgpack's own; numpy parses type names as Python."""


def pack(value: Any) -> bytes:
    """Return ``value`` (maps, lists, text, numbers, numpy arrays) as MessagePack bytes."""
    return bytes(_msgpack().packb(value, default=_to_map))


def unpack(data: bytes) -> Any:
    """Return the inverse of ``pack``.

    Raises PolicyServerError for anything else, objects and Python pickles included.
    """
    msgpack = _msgpack()
    try:
        return msgpack.unpackb(data, object_hook=_from_map)
    except (msgpack.UnpackException, *_BROKEN) as error:
        raise PolicyServerError(f"{len(data)} bytes are not msgpack with numpy arrays: {error!r}") from error


def _msgpack() -> Any:
    try:
        import msgpack
    except ImportError as error:
        raise MissingExtraError(f"policy/openpi needs msgpack: {install_command('policy')}") from error
    return msgpack


def _to_map(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "VOc":
        raise ValueError(f"arrays of {value.dtype} cannot be sent")
    if isinstance(value, np.ndarray):
        return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": value.dtype.str, b"shape": value.shape}
    if isinstance(value, np.generic):
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}
    raise TypeError(f"{type(value).__name__} cannot be sent")


def _from_map(value: dict[Any, Any]) -> Any:
    if b"__ndarray__" in value:
        dtype = np.dtype(value[b"dtype"])
        if dtype.kind in "VOc":
            raise ValueError(f"arrays of {dtype} are not accepted")
        return np.frombuffer(value[b"data"], dtype=dtype).reshape(value[b"shape"])
    if b"__npgeneric__" in value:
        return np.dtype(value[b"dtype"]).type(value[b"data"])
    return value


@dataclass
class _Connected:
    """The connection to a server, once there is one, and what it said at the beginning."""

    connection: Any = None
    metadata: dict[str, Any] = field(default_factory=dict)
    open: ExitStack = field(default_factory=ExitStack)


@dataclass(frozen=True, eq=False)
class OpenpiPolicy(Policy):
    """Connects at the first query, and reconnects after a loss; the defaults are those of ``pi0_droid``.

    Raises PolicyUnreachableError without an answer, PolicyServerError if the server reports an error or violates the
    protocol, PolicyActionError for actions of another shape or NaN, MissingExtraError without the extra.

    ``url``: such as ``ws://host:8000``. ``api_key``: as in openpi. ``connect_timeout``, ``timeout``: seconds for the
    connection with its metadata, and for an answer. ``retries``: new connections after a loss or timeout. ``prompt``:
    the instruction. ``joint_key``, ``gripper_key``, ``goal_key``: empty: not sent; ``image_keys``: camera → key of the
    server; ``image_size``: (H, W) pixels, padded with black. ``space``, ``dt``: action space, and seconds per action.
    ``gripper_column``: from 0, negative from the end; None: none; its value 0 is open by ``gripper_open`` metres, 1
    closed, also in observations.
    """

    url: str = ""
    joint_names: tuple[str, ...] = ()
    prompt: str = ""
    api_key: str = field(default="", repr=False)
    connect_timeout: float = 5.0
    timeout: float = 10.0
    retries: int = 1
    joint_key: str = "observation/joint_position"
    gripper_key: str = "observation/gripper_position"
    goal_key: str = ""
    image_keys: Mapping[str, str] = field(default_factory=dict)
    image_size: tuple[int, int] = (224, 224)
    space: str = "joint_positions"
    dt: float = 1.0 / 15.0
    gripper_column: int | None = 7
    gripper_open: float = 0.08
    _server: _Connected = field(default_factory=_Connected, init=False, repr=False)

    def __post_init__(self) -> None:
        if self.space not in {space.value for space in ActionSpace}:
            known = ", ".join(space.value for space in ActionSpace)
            raise PolicyModelError(f"space of a policy server should be one of {known} but is {self.space!r}")
        for name in ("connect_timeout", "timeout", "dt", "gripper_open"):
            if not getattr(self, name) > 0:
                raise PolicyModelError(f"{name} of a policy server should be above 0 but is {getattr(self, name)}")

    @property
    def specification(self) -> PolicySpecification:
        """The specification from the fields; the protocol does not transmit it."""
        return PolicySpecification(
            joint_names=self.joint_names,
            space=self.space,
            horizon=0,
            dt=self.dt,
            goal_size=7 if self.goal_key else 0,
            images=dict.fromkeys(self.image_keys, self.image_size),
            moves_gripper=self.gripper_column is not None,
            description=self.prompt,
        )

    def metadata(self) -> dict[str, Any]:
        """Return the server's metadata; connects if necessary."""
        self._connected(time.monotonic() + self.connect_timeout)
        return dict(self._server.metadata)

    def reset(self) -> None:
        """Do nothing: servers of this protocol have no episode state."""

    def act(self, observation: Observation) -> ActionChunk:
        """Query the server for a chunk; raises the errors listed in the class."""
        question = pack(self.question(observation))
        reason = ""
        for _ in range(self.retries + 1):
            try:
                return self._chunk(self.ask(question))
            except _ConnectionLostError as error:
                self.close()
                reason = str(error)
        tries = self.retries + 1
        raise PolicyUnreachableError(
            f"{self.url} gave no answer in {tries} {'tries' if tries > 1 else 'try'}; the last: {reason}"
        )

    def close(self) -> None:
        """Close the connection."""
        self._server.connection = None
        self._server.open.close()

    def question(self, observation: Observation) -> dict[str, Any]:
        """Return what the server is sent for an observation."""
        question: dict[str, Any] = {"prompt": self.prompt} if self.prompt else {}
        if self.joint_key:
            question[self.joint_key] = observation.joint_positions.astype(np.float32)
        if self.goal_key:
            question[self.goal_key] = observation.goal.astype(np.float32)
        if self.gripper_key:
            if observation.gripper_width is None:
                raise PolicyObservationError("the policy needs the gripper's width, which the observation lacks")
            closed = 1.0 - np.clip(observation.gripper_width / self.gripper_open, 0.0, 1.0)
            question[self.gripper_key] = np.array([closed], dtype=np.float32)
        for camera, key in self.image_keys.items():
            if camera not in observation.images:
                raise PolicyObservationError(f"the policy needs the camera {camera!r}, which the observation lacks")
            question[key] = resize_with_pad(observation.images[camera], self.image_size)
        return question

    def ask(self, question: bytes) -> dict[str, Any]:
        """Return the server's answer to a packed question; raises the errors listed in the class."""
        connection = self._connected(time.monotonic() + self.connect_timeout)
        deadline = time.monotonic() + self.timeout
        try:
            connection.send(question)
            answer = connection.recv(timeout=max(0.0, deadline - time.monotonic()))
        except _lost() as error:
            raise _ConnectionLostError(_words(error, self.timeout)) from error
        if isinstance(answer, str):
            # openpi's server sends the traceback as text, then closes.
            self.close()
            raise PolicyServerError(f"{self.url} failed: {answer.strip().splitlines()[-1][:500]}")
        return self._map(answer)

    def _connected(self, deadline: float) -> Any:
        if self._server.connection is None:
            connect = _websockets_connect()
            headers = {"Authorization": f"Api-Key {self.api_key}"} if self.api_key else None
            try:
                # No proxy from the environment: the server stands in the robot's own network.
                connecting = connect(
                    self.url,
                    compression=None,
                    max_size=None,
                    additional_headers=headers,
                    open_timeout=self.connect_timeout,
                    close_timeout=0.5,
                    proxy=None,
                )
                connection = self._server.open.enter_context(connecting)
            except ValueError as error:
                raise PolicyUnreachableError(f"{self.url!r} is not a websocket address: {error}") from error
            except _lost() as error:
                raise _ConnectionLostError(_words(error, self.connect_timeout)) from error
            try:
                greeting = connection.recv(timeout=max(0.0, deadline - time.monotonic()))
            except _lost() as error:
                self.close()
                raise _ConnectionLostError(f"no metadata: {_words(error, self.connect_timeout)}") from error
            self._server.connection = connection
            self._server.metadata = self._map(greeting)
        return self._server.connection

    def _map(self, data: Any) -> dict[str, Any]:
        value = unpack(data) if isinstance(data, bytes) else None
        if not isinstance(value, dict):
            self.close()
            raise PolicyServerError(f"{self.url} should send a map in msgpack but sends {data[:80]!r}")
        return value

    def _chunk(self, answer: dict[str, Any]) -> ActionChunk:
        actions = answer.get("actions")
        if not isinstance(actions, np.ndarray) or actions.ndim != 2 or actions.dtype.kind not in "fiu":
            found = actions.shape if isinstance(actions, np.ndarray) else type(actions).__name__
            raise PolicyActionError(f"{self.url} should answer with 'actions' of shape (H, m) but it is {found}")
        count = 6 if self.space == ActionSpace.TOOL_TWIST.value else len(self.joint_names)
        needed = count if self.gripper_column is None else max(count, self.gripper_column + 1, -self.gripper_column)
        if actions.shape[1] < needed:
            raise PolicyActionError(f"{self.url} should give at least {needed} columns but gives {actions.shape[1]}")
        widths = None
        if self.gripper_column is not None:
            widths = self.gripper_open * (1.0 - np.clip(actions[:, self.gripper_column].astype(float), 0.0, 1.0))
        return ActionChunk(actions[:, :count].astype(float), self.dt, ActionSpace(self.space), widths)


def resize_with_pad(image: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the picture scaled to fit into (H, W) and centred on black, (H, W, 3)."""
    scale = min(size[0] / image.shape[0], size[1] / image.shape[1])
    inner = max(1, round(image.shape[0] * scale)), max(1, round(image.shape[1] * scale))
    canvas = np.zeros((*size, 3), dtype=np.uint8)
    top, left = (size[0] - inner[0]) // 2, (size[1] - inner[1]) // 2
    resized = image if inner == image.shape[:2] else cv2.resize(image, inner[::-1], interpolation=cv2.INTER_LINEAR)
    canvas[top : top + inner[0], left : left + inner[1]] = resized
    return canvas


class _ConnectionLostError(Error):
    """A try that may go better the next time."""


def _websockets_connect() -> Any:
    try:
        from websockets.sync.client import connect
    except ImportError as error:
        raise MissingExtraError(f"policy/openpi needs websockets: {install_command('policy')}") from error
    return connect


def _lost() -> tuple[type[Exception], ...]:
    from websockets.exceptions import WebSocketException

    return (OSError, TimeoutError, WebSocketException)


def _words(error: Exception, limit: float) -> str:
    late = isinstance(error, TimeoutError)
    return f"no answer within {limit:g} s" if late else str(error) or type(error).__name__
