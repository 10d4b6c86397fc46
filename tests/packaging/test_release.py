"""``make release``: what it refuses, what it writes, and that a failure leaves the checkout as it was."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

CHECKOUT = Path(__file__).resolve().parents[2]
FILES = ("pyproject.toml", "CITATION.cff", "docs/getting_started.md", "docs/installation.md")
LOG = "# Changelog\n\n## Unreleased\n\n### Added\n\n- A new thing.\n\n## 0.0.9 - 2026-01-02\n\n- The first.\n"


def git(root: Path, *arguments: str) -> str:
    command = ["git", "-c", "user.name=a", "-c", "user.email=a@b.c", *arguments]
    return subprocess.run(command, cwd=root, check=True, capture_output=True, text=True).stdout


@pytest.fixture
def script() -> ModuleType:
    specification = importlib.util.spec_from_file_location("release", CHECKOUT / "scripts" / "release.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository with the files that a release changes, and a release 0.0.9 before it."""
    for who in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{who}_NAME", "a")
        monkeypatch.setenv(f"GIT_{who}_EMAIL", "a@b.c")
    root = tmp_path / "checkout"
    for name in FILES:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(CHECKOUT / name, root / name)
    (root / "CHANGELOG.md").write_text(LOG)
    (root / ".gitignore").write_text("dist/\n")
    git(root, "init", "--quiet")
    git(root, "add", ".")
    git(root, "commit", "--quiet", "--message", "all")
    git(root, "tag", "v0.0.9")
    return root


def built(root: Path, folder: Path) -> list[Path]:
    """In place of a build: the file says which version it is made of."""
    assert 'version = "0.2.0"' in (root / "pyproject.toml").read_text()
    (folder / "one.whl").write_text("")
    return [folder / "one.whl"]


@pytest.mark.parametrize(
    ("version", "told"),
    [("1.2", "three numbers"), ("v1.2.3", "three numbers"), ("0.0.9", "v0.0.9 exists"), ("0.0.8", "should be higher")],
)
def test_a_version_that_cannot_be_released_is_refused(
    version: str, told: str, script: ModuleType, checkout: Path
) -> None:
    with pytest.raises(script.ReleaseError, match=told):
        script.release(checkout, version, "2026-03-04")


def test_changes_that_are_not_committed_and_an_empty_changelog_are_refused(script: ModuleType, checkout: Path) -> None:
    (checkout / "CHANGELOG.md").write_text(LOG.replace("- A new thing.\n", ""))
    with pytest.raises(script.ReleaseError, match="not committed"):
        script.release(checkout, "0.2.0", "2026-03-04")
    git(checkout, "commit", "--quiet", "--all", "--message", "emptied")
    with pytest.raises(script.ReleaseError, match="'## Unreleased' has no entry"):
        script.release(checkout, "0.2.0", "2026-03-04")


def test_a_release_states_its_version_everywhere_and_is_tested_before_it_is_tagged(
    script: ModuleType, checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tested: list[tuple[str, str, str]] = []
    monkeypatch.setattr(script, "build", built)
    monkeypatch.setattr(
        script, "smoke_test", lambda file, version: tested.append((file.name, version, git(checkout, "tag")))
    )
    script.release(checkout, "0.2.0", "2026-03-04")
    assert tested == [("one.whl", "0.2.0", "v0.0.9\n")]
    assert git(checkout, "tag") == "v0.0.9\nv0.2.0\n"
    assert git(checkout, "status", "--porcelain") == ""
    assert git(checkout, "log", "-1", "--format=%s") == "Release 0.2.0\n"
    assert set(script.stated_versions(checkout).values()) == {"0.2.0"}
    citation = yaml.safe_load((checkout / "CITATION.cff").read_text())
    assert (citation["version"], str(citation["date-released"])) == ("0.2.0", "2026-03-04")
    script.verify(checkout, "0.2.0")
    assert script.notes(checkout, "0.2.0") == "### Added\n\n- A new thing."
    with pytest.raises(script.ReleaseError, match="states 0.2.0, not 0.3.0"):
        script.verify(checkout, "0.3.0")


def test_after_a_failed_smoke_test_nothing_has_changed(
    script: ModuleType, checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(file: Path, version: str) -> None:
        raise subprocess.CalledProcessError(1, ["python", str(file)])

    monkeypatch.setattr(script, "build", built)
    monkeypatch.setattr(script, "smoke_test", fails)
    before = git(checkout, "rev-parse", "HEAD")
    with pytest.raises(subprocess.CalledProcessError):
        script.release(checkout, "0.2.0", "2026-03-04")
    assert git(checkout, "status", "--porcelain") == ""
    assert git(checkout, "rev-parse", "HEAD") == before
    assert git(checkout, "tag") == "v0.0.9\n"


def test_the_versions_of_this_checkout_agree(script: ModuleType) -> None:
    assert len(set(script.stated_versions(CHECKOUT).values())) == 1


def test_the_smoke_test_refuses_another_version() -> None:
    command = [sys.executable, str(CHECKOUT / "scripts" / "smoke_test.py"), "99.0.0"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "not 99.0.0" in done.stderr


def workflow() -> dict[str, Any]:
    return yaml.safe_load((CHECKOUT / ".github/workflows/release.yml").read_text())["jobs"]


def test_the_workflow_publishes_only_what_was_checked_and_smoke_tested() -> None:
    jobs = workflow()
    commands = "\n".join(step.get("run", "") for step in jobs["build"]["steps"])
    places = [commands.index(word) for word in ("--verify", "make test", "make dist", "--smoke-test", "--notes")]
    assert places == sorted(places)
    assert [jobs[name]["needs"] for name in ("github", "pypi")] == ["build", "build"]


@pytest.mark.parametrize(
    "form", sorted((CHECKOUT / ".github/ISSUE_TEMPLATE").glob("*.yml")), ids=lambda path: path.stem
)
def test_the_issue_forms_are_forms(form: Path) -> None:
    read = yaml.safe_load(form.read_text())
    if form.stem == "config":
        assert read == {"blank_issues_enabled": True}
        return
    assert {"name", "description", "body"} <= read.keys()
    identifiers = [field["id"] for field in read["body"]]
    assert len(set(identifiers)) == len(identifiers) >= 2
    assert all(field["type"] in ("textarea", "dropdown") and field["attributes"]["label"] for field in read["body"])
