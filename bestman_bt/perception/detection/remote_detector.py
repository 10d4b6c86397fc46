"""A detector on another machine, asked over HTTP: open-vocabulary models on a GPU.

The protocol is one POST of JSON (see remote_protocol and docs/detectors.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import httpx

from bestman_bt.bounded_post import AnswerRefusedError, NoAnswerError, PostLimits, ask_again, post_json
from bestman_bt.messages import RGBDImage
from bestman_bt.perception.detection.from_image import FromImage
from bestman_bt.perception.detection.image_detection import ImageDetection
from bestman_bt.perception.detection.remote_protocol import reply_detections, request_body
from bestman_bt.perception.errors import DetectorReplyError, DetectorUnreachableError


@dataclass(frozen=True)
class RemoteDetector(FromImage):
    """Known objects, and other things by label, through a detector on another machine.

    Posts the picture and the names, reads the answer; keeps nothing between two questions. Raises
    DetectorUnreachableError where no answer came, DetectorReplyError where it breaks the protocol.

    ``url``: where questions are posted. ``connect_timeout``, ``timeout``: seconds for the connection, and for each
    whole try. ``retries``: further tries where the server cannot be reached, is late, busy (429) or fails (5xx), after
    ``backoff`` seconds, then twice that, and so on. ``max_reply``: bytes. ``with_depth``: send the depth image too.
    """

    url: str = ""
    connect_timeout: Annotated[float, "s"] = 2.0
    timeout: Annotated[float, "s"] = 10.0
    retries: int = 2
    backoff: Annotated[float, "s"] = 0.25
    max_reply: int = 16_000_000
    with_depth: bool = False

    def find(self, image: RGBDImage, names: Sequence[str]) -> tuple[ImageDetection, ...]:
        """See FromImage."""
        if not names or image.rgb.size == 0:
            return ()
        body = request_body(image, names, self.with_depth)
        limits = PostLimits(self.connect_timeout, self.timeout, self.retries, self.backoff, self.max_reply)
        try:
            # No proxy from the environment: the server stands in the robot's own network.
            answer = ask_again(lambda: post_json(self.url, body, limits, {}, through_proxy=False), limits)
            if answer.status != 200:
                raise DetectorReplyError(f"{self.url}: status {answer.status}, 200 is expected")
            return reply_detections(answer.content, image, names)
        except NoAnswerError as error:
            raise DetectorUnreachableError(f"{self.url} {error}") from error
        except (httpx.UnsupportedProtocol, httpx.InvalidURL) as error:
            raise DetectorUnreachableError(
                f"{self.url!r} is no http address; give 'url' of detection/remote"
            ) from error
        except (AnswerRefusedError, ValueError) as error:
            raise DetectorReplyError(f"{self.url}: {error}") from error
