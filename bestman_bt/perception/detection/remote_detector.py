"""A detector on another machine, queried over HTTP: open-vocabulary models on a GPU.

The protocol is one POST of JSON (see remote_protocol and docs/detectors.md).
"""

from __future__ import annotations

import base64
import binascii
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError
from typing_extensions import override

from bestman_bt.messages import RGBDImage
from bestman_bt.perception.detection.from_image import FromImage, ImageDetection
from bestman_bt.perception.errors import DetectorReplyError, DetectorUnreachableError
from bestman_bt.perception.view import known_depth

_PNG = b"\x89PNG\r\n\x1a\n"


class RemoteMask(BaseModel):
    """A mask, as one of two fields: ``png``, base64 of a grey PNG of the image's size (not 0: inside); ``counts``, the
    run lengths of COCO: column by column, background first.
    """

    png: str | None = None
    counts: list[Annotated[int, Field(ge=0)]] | None = None


class RemoteDetection(BaseModel):
    """One labelled detection. ``box``: left, top, right, bottom in pixels."""

    label: str
    score: Annotated[float, Field(ge=0.0, le=1.0)]
    box: tuple[float, float, float, float]
    mask: RemoteMask | None = None


class RemoteReply(BaseModel):
    """The answer; other fields are ignored."""

    detections: list[RemoteDetection]


def request_body(image: RGBDImage, names: Sequence[str], with_depth: bool) -> dict[str, Any]:
    """Return the request as JSON: names, size and the picture as PNG; depth in millimetres, 0 unknown."""
    k = image.intrinsics
    body: dict[str, Any] = {
        "names": list(names),
        "width": k.width,
        "height": k.height,
        "rgb_png": _encoded(cv2.cvtColor(image.rgb, cv2.COLOR_RGB2BGR)),
    }
    if with_depth:
        millimetres = np.clip(np.rint(1000.0 * known_depth(image.depth).astype(np.float64)), 0, 65535)
        body["depth_png"] = _encoded(millimetres.astype(np.uint16))
    return body


def reply_detections(content: bytes, image: RGBDImage, names: Sequence[str]) -> tuple[ImageDetection, ...]:
    """Return the detections in a reply, highest score first; labels that were not requested are omitted.

    Raises ValueError, with the reason, if the reply is invalid.
    """
    try:
        reply = RemoteReply.model_validate_json(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "the answer"
        raise ValueError(f"{where}: {first['msg']}") from error
    height, width = image.depth.shape
    found = []
    for index, item in enumerate(reply.detections):
        if item.label not in names:
            continue
        where = f"detections.{index}"
        left, top, right, bottom = item.box
        if not (np.isfinite(item.box).all() and left < right and top < bottom):
            raise ValueError(f"{where}.box: {item.box} is not left < right, top < bottom")
        mask = None if item.mask is None else _mask(item.mask, (height, width), f"{where}.mask")
        clipped = ImageDetection(item.label, item.score, item.box, mask).clipped(width, height)
        if clipped is None:
            raise ValueError(f"{where}.box: {item.box} lies outside the image of {width} x {height} pixels")
        found.append(clipped)
    return tuple(sorted(found, key=lambda detection: -detection.score))


def _mask(mask: RemoteMask, shape: tuple[int, int], where: str) -> NDArray[np.bool_]:
    if (mask.png is None) == (mask.counts is None):
        raise ValueError(f"{where}: needs either png or counts")
    if mask.png is not None:
        return _decoded(mask.png, shape, f"{where}.png")
    counts = np.array(mask.counts, dtype=np.int64)
    height, width = shape
    if (counts > height * width).any() or int(counts.sum()) != height * width:
        raise ValueError(f"{where}.counts: runs of {int(counts.sum())} pixels, the image has {height * width}")
    inside = np.repeat(np.arange(len(counts)) % 2 == 1, counts)
    return np.ascontiguousarray(inside.reshape(width, height).T)


def _decoded(text: str, shape: tuple[int, int], where: str) -> NDArray[np.bool_]:
    try:
        data = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise ValueError(f"{where}: is not base64") from error
    if not data.startswith(_PNG) or len(data) < 24:
        raise ValueError(f"{where}: is not a PNG")
    # The size stands at the beginning: a small file may unpack to gigabytes.
    width, height = int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    if (height, width) != shape:
        raise ValueError(f"{where}: has {width} x {height} pixels, the image {shape[1]} x {shape[0]}")
    picture = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_GRAYSCALE)
    if picture is None or picture.shape != shape:
        raise ValueError(f"{where}: is a PNG that cannot be read")
    return np.asarray(picture) > 0


def _encoded(picture: NDArray[Any]) -> str:
    good, data = cv2.imencode(".png", picture)
    if not good:
        raise ValueError(f"a picture {picture.shape} cannot be written as PNG")
    return base64.b64encode(data.tobytes()).decode("ascii")


@dataclass(frozen=True)
class RemoteDetector(FromImage):
    """Detects objects with a detector on another machine.

    Posts the image and the names, and reads the reply; keeps no state between requests. Raises DetectorUnreachableError
    without a reply, DetectorReplyError for a reply that violates the protocol.

    ``url``: address of the requests. ``connect_timeout``, ``timeout``: seconds for the connection, and for each
    attempt. ``retries``: further attempts if the server cannot be reached, is late, busy (429) or fails (5xx), after
    ``backoff`` seconds, doubled each time. ``max_reply``: bytes. ``with_depth``: whether to also send the depth image.
    """

    url: str = ""
    connect_timeout: Annotated[float, "s"] = 2.0
    timeout: Annotated[float, "s"] = 10.0
    retries: int = 2
    backoff: Annotated[float, "s"] = 0.25
    max_reply: int = 16_000_000
    with_depth: bool = False

    @override
    def find(self, image: RGBDImage, names: Sequence[str]) -> tuple[ImageDetection, ...]:
        import httpx  # takes a tenth of a second, and other detectors do not need it

        from bestman_bt.http_client import AnswerRefusedError, NoAnswerError, PostLimits, post_json, with_retries

        if not names or image.rgb.size == 0:
            return ()
        body = request_body(image, names, self.with_depth)
        limits = PostLimits(self.connect_timeout, self.timeout, self.retries, self.backoff, self.max_reply)
        try:
            # No proxy from the environment: the server stands in the robot's own network.
            answer = with_retries(lambda: post_json(self.url, body, limits, {}, through_proxy=False), limits)
            if answer.status != 200:
                raise DetectorReplyError(f"{self.url}: status {answer.status}, 200 is expected")
            return reply_detections(answer.content, image, names)
        except NoAnswerError as error:
            raise DetectorUnreachableError(f"{self.url} {error}") from error
        except (httpx.UnsupportedProtocol, httpx.InvalidURL) as error:
            raise DetectorUnreachableError(
                f"{self.url!r} is not an http address; give 'url' of detection/remote"
            ) from error
        except (AnswerRefusedError, ValueError) as error:
            raise DetectorReplyError(f"{self.url}: {error}") from error
