"""The live page in Debian's Chromium, driven by playwright-core; the stories are in the ``*.test.mjs`` beside this."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
PAGE = HERE.parents[2] / "bestman_bt" / "monitor" / "page"
STATIC = PAGE.parent / "static"
NODE = shutil.which("node")
CHROMIUM = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None
)
REQUIRED = os.environ.get("BROWSER_TESTS") == "required"
"""Where they must not be skipped."""
QUICK = "showing.test.mjs"
STORIES = [
    pytest.param(path, marks=() if path.name == QUICK else pytest.mark.slow)
    for path in sorted(HERE.glob("*.test.mjs"), key=lambda path: path.name)
]


def _missing() -> str | None:
    if NODE is None:
        return "node is not installed (Debian: apt install nodejs npm)"
    if CHROMIUM is None:
        return "chromium is not installed (Debian: apt install chromium)"
    if not (PAGE / "node_modules" / "playwright-core").is_dir():
        return "the page's node packages are not installed (npm ci --prefix bestman_bt/monitor/page)"
    return None


@pytest.mark.skipif(_missing() is not None and not REQUIRED, reason=f"browser tests: {_missing()}")
@pytest.mark.parametrize("story", STORIES, ids=lambda path: path.name.split(".")[0])
def test_the_page_passes_each_browser_test(story: Path) -> None:
    missing = _missing()
    if NODE is None or CHROMIUM is None or missing is not None:
        pytest.fail(f"BROWSER_TESTS=required, but {missing}")
    ran = subprocess.run(
        [NODE, "--test", "--test-reporter=spec", str(story)],
        env={**os.environ, "CHROMIUM": CHROMIUM, "PYTHON": sys.executable},
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert ran.returncode == 0, f"{ran.stdout}\n{ran.stderr}"


def test_the_built_page_is_of_these_sources() -> None:
    names = ["../../engine/palette.json", "index.html", "package-lock.json"]
    for folder in ("src", "public"):
        names += [path.relative_to(PAGE).as_posix() for path in (PAGE / folder).rglob("*") if path.is_file()]
    digest = hashlib.sha256()
    for name in sorted(names):
        digest.update(f"{name}\n".encode() + (PAGE / name).read_bytes())
    built = (STATIC / "SOURCES.sha256").read_text().strip()
    assert digest.hexdigest() == built, "build it anew: npm run build --prefix bestman_bt/monitor/page"


def test_the_page_asks_nobody_else_for_anything() -> None:
    texts = [(STATIC / "index.html").read_text()] + [path.read_text() for path in STATIC.rglob("*.css")]
    for text in texts:
        assert "http://" not in text
        assert "https://" not in text
        assert "data:" not in text
