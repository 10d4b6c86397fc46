from __future__ import annotations

import base64
import json
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from benchmarks.rendered_table import TrueObject, known_models, render_table
from bestman_bt.messages import CameraIntrinsics, Pose, RGBDImage
from bestman_bt.perception.detection.remote_detector import RemoteDetector
from bestman_bt.perception.errors import DetectorReplyError, DetectorUnreachableError
from tests.answering_server import Server, Way, drips, drips_headers, raw, serving_at, sleeps
from tests.hal.twinned import wait_for
from tests.rigs.free_port import free_port

WIDTH, HEIGHT = 64, 48


@pytest.fixture
def server() -> Iterator[Server]:
    with serving_at("/detect") as found:
        yield found


def reply(*detections: dict[str, Any]) -> Way:
    return raw(json.dumps({"detections": detections}).encode())


def thing(**changed: object) -> dict[str, Any]:
    return {"label": "cup", "score": 0.8, "box": [10.0, 5.0, 30.0, 25.0], **changed}


def png(mask: np.ndarray) -> str:
    return base64.b64encode(cv2.imencode(".png", mask.astype(np.uint8) * 255)[1].tobytes()).decode()


def picture() -> RGBDImage:
    rng = np.random.default_rng(0)
    depth = np.full((HEIGHT, WIDTH), 1.234, np.float32)
    depth[0, :3] = np.nan, np.inf, 0.0
    k = CameraIntrinsics(WIDTH, HEIGHT, 60.0, 60.0, 32.0, 24.0)
    return RGBDImage(rng.integers(0, 255, (HEIGHT, WIDTH, 3)).astype(np.uint8), depth, k, 0.0)


def detector(url: str, **changed: object) -> RemoteDetector:
    settings = {"timeout": 0.5, "connect_timeout": 0.5, "retries": 0, "backoff": 0.01, **changed}
    return RemoteDetector(url=url, **settings)


def test_names_and_pictures_arrive_as_they_were_sent(server: Server) -> None:
    server.ways = [reply()]
    image = picture()
    assert detector(server.url, with_depth=True).find(image, ["cup", "red can"]) == ()
    (asked,) = server.questions
    assert (asked["names"], asked["width"], asked["height"]) == (["cup", "red can"], WIDTH, HEIGHT)
    rgb = cv2.imdecode(np.frombuffer(base64.b64decode(asked["rgb_png"]), np.uint8), cv2.IMREAD_COLOR)
    np.testing.assert_array_equal(rgb[..., ::-1], image.rgb)
    depth = cv2.imdecode(np.frombuffer(base64.b64decode(asked["depth_png"]), np.uint8), cv2.IMREAD_UNCHANGED)
    assert depth.dtype == np.uint16
    np.testing.assert_array_equal(depth[0, :4], [0, 0, 0, 1234])


def test_pictures_of_the_room_never_go_through_a_proxy(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("no_proxy", "NO_PROXY"):
        monkeypatch.delenv(name, raising=False)
    server.ways = [reply()]
    with serving_at("", raw(b"")) as proxy:
        for name in ("http_proxy", "all_proxy"):
            monkeypatch.setenv(name, f"http://127.0.0.1:{proxy.server_address[1]}")
        assert detector(server.url).find(picture(), ["cup"]) == ()
        assert proxy.questions == []
    assert len(server.questions) == 1


def test_depth_stays_here_unless_it_is_wanted(server: Server) -> None:
    server.ways = [reply()]
    detector(server.url).find(picture(), ["cup"])
    assert "depth_png" not in server.questions[0]


def test_boxes_and_both_kinds_of_masks_come_back(server: Server) -> None:
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[5:25, 10:30] = True
    runs = np.flatnonzero(np.diff(np.concatenate([[False], mask.T.ravel()]))) + 0
    counts = np.diff([0, *runs, mask.size]).tolist()
    server.ways = [
        reply(thing(score=0.5, mask={"png": png(mask)}), thing(score=0.9), thing(score=0.7, mask={"counts": counts}))
    ]
    found = detector(server.url).find(picture(), ["cup"])
    assert [item.score for item in found] == [0.9, 0.7, 0.5]
    assert found[0].mask is None
    np.testing.assert_array_equal(found[1].mask, mask)
    np.testing.assert_array_equal(found[2].mask, mask)


def test_boxes_are_cut_at_the_border_and_labels_that_nobody_asked_for_are_ignored(server: Server) -> None:
    server.ways = [reply(thing(box=[-20.0, 5.0, 30.0, 900.0]), thing(label="elephant", box=[1e9, 0, 0, 0]))]
    (found,) = detector(server.url).find(picture(), ["cup"])
    assert found.box == (-0.5, 5.0, 30.0, HEIGHT - 0.5)


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (raw(b"<html>hello</html>"), "Invalid JSON"),
        (raw(b""), "Invalid JSON"),
        (raw(b"\xff\xfe\x00"), "Invalid JSON"),
        (raw(b"[]"), "the answer: "),
        (raw(b'{"objects": []}'), "detections: Field required"),
        (reply({"label": "cup"}), "detections.0.score: Field required"),
        (reply(thing(score=7.0)), "detections.0.score: .*less than or equal to 1"),
        (reply(thing(score="high")), "detections.0.score"),
        (reply(thing(box=[1, 2, 3])), "detections.0.box"),
        (reply(thing(box=[30, 5, 10, 25])), "detections.0.box: .* is not left < right"),
        (reply(thing(), thing(box=[100, 5, 130, 25])), "detections.1.box: .* outside the image of 64 x 48"),
        (reply(thing(mask={})), "detections.0.mask: needs either png or counts"),
        (reply(thing(mask={"png": "%%%"})), "mask.png: is not base64"),
        (reply(thing(mask={"png": base64.b64encode(b"GIF89a").decode()})), "mask.png: is not a PNG"),
        (reply(thing(mask={"png": png(np.ones((10, 10)))})), "mask.png: has 10 x 10 pixels, the image 64 x 48"),
        (reply(thing(mask={"png": png(np.ones((HEIGHT, WIDTH)))[:60]})), "mask.png: is a PNG that cannot be read"),
        (reply(thing(mask={"counts": [5, 7]})), "mask.counts: runs of 12 pixels, the image has 3072"),
        (reply(thing(mask={"counts": [-5, 3077]})), "mask.counts.0: .*greater than or equal to 0"),
        (raw(b"no", status=404), "status 404, 200 is expected"),
        (raw(b"", status=302), "status 302, 200 is expected"),
    ],
)
def test_answers_that_break_the_protocol_name_the_address_and_the_field(
    server: Server, answer: Way, message: str
) -> None:
    server.ways = [answer]
    with pytest.raises(
        DetectorReplyError, match=f"{re.escape(server.url)}: .*{message}|{re.escape(server.url)}: {message}"
    ):
        detector(server.url, retries=3).find(picture(), ["cup"])
    assert len(server.questions) == 1


def test_an_answer_that_is_too_long_is_not_read_to_its_end(server: Server) -> None:
    server.ways = [raw(b" " * 300_000)]
    with pytest.raises(DetectorReplyError, match="more than 100000 bytes"):
        detector(server.url, max_reply=100_000).find(picture(), ["cup"])


@pytest.mark.parametrize("status", [500, 503, 429])
def test_a_server_that_fails_once_is_asked_again(server: Server, status: int) -> None:
    server.ways = [raw(b"oops", status), reply(thing())]
    assert len(detector(server.url, retries=1).find(picture(), ["cup"])) == 1
    assert len(server.questions) == 2


def test_a_server_that_always_fails_is_asked_so_often_and_no_more(server: Server) -> None:
    server.ways = [raw(b"oops", 500)]
    with pytest.raises(
        DetectorUnreachableError, match=rf"{re.escape(server.url)} gave no answer in 3 tries.*status 500"
    ):
        detector(server.url, retries=2).find(picture(), ["cup"])
    assert len(server.questions) == 3


def test_between_tries_it_waits_longer_and_longer(server: Server) -> None:
    server.ways = [raw(b"oops", 500)]
    start = time.monotonic()
    with pytest.raises(DetectorUnreachableError):
        detector(server.url, retries=2, backoff=0.1).find(picture(), ["cup"])
    assert time.monotonic() - start >= 0.3


@pytest.mark.parametrize("answer", [sleeps(1.5, reply()), drips, drips_headers], ids=["silent", "body", "headers"])
def test_a_late_answer_is_given_up_in_time(server: Server, answer: Way) -> None:
    server.ways = [answer]
    start = time.monotonic()
    with pytest.raises(DetectorUnreachableError, match="no whole answer after"):
        detector(server.url, timeout=0.3).find(picture(), ["cup"])
    assert time.monotonic() - start < 20.0  # a loaded machine takes some of them


def test_a_refused_connection_is_reported(server: Server) -> None:
    port = free_port()
    with pytest.raises(DetectorUnreachableError, match=f"127.0.0.1:{port}/detect gave no answer in 2 tries; .*refused"):
        detector(f"http://127.0.0.1:{port}/detect", retries=1).find(picture(), ["cup"])


@pytest.mark.parametrize("url", ["", "gpu-box", "ftp://gpu-box/", "http://[::bad"])
def test_what_is_no_address_is_reported(url: str) -> None:
    with pytest.raises(DetectorUnreachableError, match="is not an http address; give 'url' of detection/remote"):
        detector(url).find(picture(), ["cup"])


def test_without_names_nobody_is_asked(server: Server) -> None:
    assert detector(server.url).find(picture(), []) == ()
    assert server.questions == []


@pytest.fixture
def documented_server(tmp_path: Path) -> Iterator[str]:
    """The server of docs/detectors.md, in a process of its own."""
    page = (Path(__file__).parents[3] / "docs" / "detectors.md").read_text(encoding="utf-8")
    source = re.search(r'```python title="server.py"\n(.*?)```', page, re.DOTALL)
    assert source is not None
    path = tmp_path / "server.py"
    path.write_text(source.group(1), encoding="utf-8")
    port = free_port()  # one that a probe may have for its own end would answer itself
    process = subprocess.Popen([sys.executable, str(path), str(port)], stderr=subprocess.DEVNULL)

    def answers() -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", port)) == 0

    try:
        wait_for(answers, "the server listens")
        yield f"http://127.0.0.1:{port}/detect"
    finally:
        process.terminate()
        process.wait(timeout=10)


def test_the_documented_server_names_objects_that_then_have_poses(documented_server: str) -> None:
    cup, can, box, tin, cube = known_models(0)
    table = Pose.from_xyz_rpy((0.76, 0.0, 0.75))
    items = [
        TrueObject(model, table @ Pose.from_xyz_rpy((-0.1, y, model.size[2] / 2), (0, 0, 0.4)), True)
        for model, y in ((box, -0.2), (tin, 0.0), (cup, 0.2))
    ]
    scene = render_table(items, table, (0.8, 1.2), np.random.default_rng(0))
    detector = RemoteDetector(
        url=documented_server, prompts={"box": "red box", "block": "green block"}, names=("block",), timeout=20.0
    )
    found = detector.detect(scene.view, scene.region, [box, can, cube], np.random.default_rng(0))
    (detection,) = found.detections
    assert detection.name == "box"
    assert np.linalg.norm(detection.pose.position - items[0].pose.position) < 0.004
    block = found.labelled("block")
    assert np.linalg.norm(block.points.mean(axis=0) - items[1].pose.position) < 0.05
    assert len(found.unknown) == 2
