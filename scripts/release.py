"""Makes a release: ``make release VERSION=x.y.z`` checks, builds, smoke-tests, commits and tags it; it pushes nothing.

``--notes`` prints the changelog's section of a version, ``--verify`` compares all files that state the version with it;
``.github/workflows/release.yml`` calls both for the tag that is pushed.
"""

from __future__ import annotations

import argparse
import datetime
import re
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]
CHANGELOG = "CHANGELOG.md"
UNRELEASED = "## Unreleased"
STATED = {
    "pyproject.toml": r'^version = "(.+)"$',
    "CITATION.cff": r"^version: (.+)$",
    "docs/getting_started.md": r"bestman_bt-([\d.]+)-py3-none-any\.whl",
    "docs/installation.md": r"bestman_bt-([\d.]+)-py3-none-any\.whl",
}
"""File → pattern whose group is the version."""
SMOKE_TEST = Path(__file__).with_name("smoke_test.py")


class ReleaseError(Exception):
    """The release cannot be made, with the reason; nothing has been changed, or all of it has been undone."""


def git(root: Path, *arguments: str) -> str:
    """Run git in ``root`` and return its output; ReleaseError with what git says if it fails."""
    done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ReleaseError(f"git {' '.join(arguments)}: {done.stderr.strip()}")
    return done.stdout.strip()


def stated_versions(root: Path) -> dict[str, str]:
    """File → the version that it states."""
    found = {}
    for name, pattern in STATED.items():
        matches = set(re.findall(pattern, (root / name).read_text(), re.MULTILINE))
        if len(matches) != 1:
            raise ReleaseError(f"{name}: should state one version, states {sorted(matches) or 'none'}")
        (found[name],) = matches
    return found


def notes(root: Path, version: str) -> str:
    """The changelog's section of ``version``, or of what is unreleased; ReleaseError if it is missing or empty."""
    heading = UNRELEASED if version == "Unreleased" else f"## {version} "
    sections = re.split(r"^(?=## )", (root / CHANGELOG).read_text(), flags=re.MULTILINE)
    found = [section for section in sections if f"{section.splitlines()[0]} ".startswith(heading)]
    if not found:
        raise ReleaseError(f"{CHANGELOG}: has no section '{heading.strip()}'")
    text = found[0].partition("\n")[2].strip()
    if not re.search(r"^- ", text, re.MULTILINE):
        raise ReleaseError(f"{CHANGELOG}: the section '{heading.strip()}' has no entry")
    return text


def verify(root: Path, version: str) -> None:
    """Raise ReleaseError unless all files state ``version`` and the changelog has a section of it."""
    wrong = {name: stated for name, stated in stated_versions(root).items() if stated != version}
    if wrong:
        raise ReleaseError("; ".join(f"{name} states {stated}, not {version}" for name, stated in wrong.items()))
    notes(root, version)


def check(root: Path, version: str) -> None:
    """Raise ReleaseError unless a release of this version can be made from the checkout as it is."""
    if not re.fullmatch(r"(0|[1-9]\d*)\.(0|[1-9]\d*)\.(0|[1-9]\d*)", version):
        raise ReleaseError(f"VERSION={version}: should be three numbers, such as 0.2.0")
    if git(root, "status", "--porcelain"):
        raise ReleaseError("the checkout has changes that are not committed; 'git status' lists them")
    if git(root, "tag", "--list", f"v{version}"):
        raise ReleaseError(f"the tag v{version} exists already")
    tags = [tag[1:] for tag in git(root, "tag", "--list", "v*").splitlines() if re.fullmatch(r"v\d+\.\d+\.\d+", tag)]
    newest = max(tags, key=_numbers, default="0.0.0")
    if _numbers(version) <= _numbers(newest):
        raise ReleaseError(f"VERSION={version}: the newest release is {newest}; the version should be higher")
    stated_versions(root)
    notes(root, "Unreleased")


def write_version(root: Path, version: str, date: str) -> list[str]:
    """State ``version`` in all files and date the changelog's unreleased section; return the files' names."""
    for name, pattern in STATED.items():
        text = (root / name).read_text()
        (root / name).write_text(re.sub(pattern, lambda m: m[0].replace(m[1], version), text, flags=re.MULTILINE))
    citation = root / "CITATION.cff"
    undated = re.sub(r"^date-released: .+\n", "", citation.read_text(), flags=re.MULTILINE)
    citation.write_text(re.sub(r"^(version: .+\n)", rf"\1date-released: {date}\n", undated, flags=re.MULTILINE))
    changelog = root / CHANGELOG
    dated = f"{UNRELEASED}\n\n## {version} - {date}"
    changelog.write_text(changelog.read_text().replace(UNRELEASED, dated, 1))
    return [*STATED, CHANGELOG]


def build(root: Path, folder: Path) -> list[Path]:
    """Build the wheel and the source archive into ``folder``."""
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(root)]
    subprocess.run(command, check=True, stdout=sys.stderr)
    return sorted(folder.iterdir())


def smoke_test(file: Path, version: str) -> None:
    """Install ``file`` into a fresh environment, and run ``smoke_test.py`` there in a folder without the checkout."""
    with tempfile.TemporaryDirectory() as folder:
        environment = Path(folder) / "environment"
        venv.create(environment, with_pip=True)
        python = environment / "bin" / "python"
        subprocess.run([python, "-m", "pip", "install", "--quiet", f"{file}[sim]"], check=True)
        elsewhere = Path(folder) / "elsewhere"
        elsewhere.mkdir()
        subprocess.run([python, "-I", SMOKE_TEST, version], cwd=elsewhere, check=True)


def release(root: Path, version: str, date: str) -> None:
    """Make the release; whatever fails, the files are as before, and there is neither commit nor tag."""
    check(root, version)
    changed = write_version(root, version, date)
    try:
        verify(root, version)
        dist = root / "dist" / version
        dist.mkdir(parents=True, exist_ok=True)
        for file in dist.iterdir():
            file.unlink()
        for file in build(root, dist):
            _print(f"smoke test of {file.name} in a fresh environment")
            smoke_test(file, version)
        git(root, "commit", "--quiet", "--message", f"Release {version}", "--", *changed)
    except (ReleaseError, subprocess.CalledProcessError):
        git(root, "checkout", "--quiet", "HEAD", "--", *changed)
        raise
    git(root, "tag", "--annotate", f"v{version}", "--message", f"bestman-bt {version}")
    _print(f"released {version}: {dist}, commit and tag v{version}; nothing was pushed. To publish it:")
    _print(f"    git push origin HEAD v{version}")


def main() -> int:
    """Do what the arguments say; returns the exit code, 2 where the release cannot be made."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("version", help="such as 0.2.0")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--notes", action="store_true", help="print the changelog's section")
    what.add_argument("--verify", action="store_true", help="compare the files that state the version")
    what.add_argument("--smoke-test", nargs="+", type=Path, metavar="FILE", help="test wheels and source archives")
    asked = parser.parse_args()
    try:
        if asked.notes:
            print(notes(CHECKOUT, asked.version))
        elif asked.verify:
            verify(CHECKOUT, asked.version)
        elif asked.smoke_test:
            for file in asked.smoke_test:
                smoke_test(file.resolve(), asked.version)
        else:
            release(CHECKOUT, asked.version, datetime.datetime.now(datetime.UTC).date().isoformat())
    except ReleaseError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except subprocess.CalledProcessError as error:
        print(f"error: {' '.join(map(str, error.cmd))} ended with exit code {error.returncode}", file=sys.stderr)
        return 1
    return 0


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, version.split(".")))


def _print(text: str) -> None:
    print(text, file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
