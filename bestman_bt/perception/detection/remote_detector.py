"""A detector on another machine, asked over HTTP: open-vocabulary models on a GPU.

The protocol is one POST of JSON (see remote_protocol and docs/detectors.md).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import httpx

from bestman_bt.messages import RGBDImage
from bestman_bt.perception.detection.from_image import FromImage, FromImageParameters
from bestman_bt.perception.detection.image_detector import ImageDetection, ImageDetector
from bestman_bt.perception.detection.remote_protocol import reply_detections, request_body
from bestman_bt.perception.errors import DetectorReplyError, DetectorUnreachableError
from bestman_bt.perception.pose_estimation import PoseEstimator
from bestman_bt.perception.segmentation import Segmentation


@dataclass(frozen=True)
class RemoteDetectorParameters(FromImageParameters):
    """``url``: where questions are posted. ``connect_timeout``, ``timeout``: seconds for the connection, and for each
    whole try. ``retries``: further tries where the server cannot be reached, is late, busy (429) or fails (5xx), after
    ``backoff`` seconds, then twice that, and so on. ``max_reply``: bytes. ``with_depth``: send the depth image too.
    """

    url: str = ""
    connect_timeout: float = 2.0
    timeout: float = 10.0
    retries: int = 2
    backoff: float = 0.25
    max_reply: int = 16_000_000
    with_depth: bool = False


class RemoteImageDetector(ImageDetector):
    """Posts the picture and the names, reads the answer; keeps nothing between two questions.

    Raises DetectorUnreachableError where no answer came, DetectorReplyError where it breaks the protocol.
    """

    def __init__(self, parameters: RemoteDetectorParameters) -> None:
        self.parameters = parameters

    def find(self, image: RGBDImage, names: Sequence[str]) -> tuple[ImageDetection, ...]:
        """See ImageDetector."""
        if not names or image.rgb.size == 0:
            return ()
        p = self.parameters
        body = request_body(image, names, p.with_depth)
        reason = ""
        for attempt in range(p.retries + 1):
            if attempt:
                time.sleep(p.backoff * 2 ** (attempt - 1))
            try:
                content = self._post(body)
            except _TryAgainError as error:
                reason = str(error)
                continue
            try:
                return reply_detections(content, image, names)
            except ValueError as error:
                raise DetectorReplyError(f"{p.url}: {error}") from error
        tries = f"{p.retries + 1} tries" if p.retries else "one try"
        raise DetectorUnreachableError(f"{p.url} gave no answer in {tries}; the last: {reason}")

    def _post(self, body: dict[str, object]) -> bytes:
        p = self.parameters
        started = time.monotonic()
        limits = httpx.Timeout(p.timeout, connect=min(p.connect_timeout, p.timeout))
        content = bytearray()
        try:
            # No proxy from the environment: the server stands in the robot's own network.
            with (
                httpx.Client(timeout=limits, trust_env=False, follow_redirects=False) as client,
                client.stream("POST", p.url, json=body, headers={"Accept-Encoding": "identity"}) as answer,
            ):
                if answer.status_code == 429 or answer.status_code >= 500:
                    raise _TryAgainError(f"status {answer.status_code}")
                if answer.status_code != 200:
                    raise DetectorReplyError(f"{p.url}: status {answer.status_code}, 200 is expected")
                for chunk in answer.iter_bytes():
                    content += chunk
                    if len(content) > p.max_reply:
                        raise DetectorReplyError(f"{p.url}: the answer has more than {p.max_reply} bytes")
                    # The library's limit holds for each read: a server that drips would never be late.
                    if time.monotonic() - started > p.timeout:
                        raise _TryAgainError(f"not done after {p.timeout:g} s")
        except httpx.TimeoutException as error:
            raise _TryAgainError(
                f"no answer after {time.monotonic() - started:.1f} s ({type(error).__name__})"
            ) from error
        except (httpx.UnsupportedProtocol, httpx.InvalidURL) as error:
            raise DetectorUnreachableError(f"{p.url!r} is no http address; give 'url' of detection/remote") from error
        except httpx.HTTPError as error:
            raise _TryAgainError(str(error) or type(error).__name__) from error
        return bytes(content)


class RemoteDetector(FromImage):
    """Known objects, and other things by label, through a detector on another machine."""

    def __init__(
        self,
        parameters: RemoteDetectorParameters | None = None,
        segmentation: Segmentation | None = None,
        pose_estimator: PoseEstimator | None = None,
    ) -> None:
        parameters = parameters or RemoteDetectorParameters()
        super().__init__(RemoteImageDetector(parameters), parameters, segmentation, pose_estimator)


class _TryAgainError(Exception):
    """A try that may go better the next time."""
