"""Examples: bestman-bt dataset info picks; bestman-bt dataset merge picks more_picks -o all_picks."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from bestman_bt.cli.options import Json, Png, json_output
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.manipulation.policy.training.dataset_folder import FAILURES, DatasetError, DatasetFolder, entry_names

verbs = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    no_args_is_help=True,
    help="Describe, show, merge and replay datasets of LeRobot.",
    epilog=__doc__,
)
Dataset = Annotated[Path, typer.Argument(metavar="DIR", help="A dataset of LeRobot, layout 3.0.")]

Episode = Annotated[int, typer.Option(min=0, help="Its index, from 0.")]


@verbs.command()
def info(dataset: Dataset, as_json: Json = False) -> None:
    """Print episodes, frames, tasks, seeds, features with their units, the size, and failed episodes kept apart."""
    with json_output(as_json) as print_json, _refused():
        document = _document(_read(dataset))
        print_json(document)
    if not as_json:
        seconds = document["frames"] / document["fps"]
        print(
            f"{dataset}: {document['episodes']} episodes, {document['frames']} frames at {document['fps']} Hz "
            f"({seconds:.0f} s), {document['bytes'] / 1e6:.1f} MB, robot {document['robot'] or 'not named'}"
        )
        for task in document["tasks"]:
            seeds = f", seeds {_ranges(task['seeds'])}" if task["seeds"] else ""
            print(f"  task {task['task']!r}: {task['episodes']} episodes{seeds}")
        for name, feature in document["features"].items():
            print(f"  {name}: {feature['dtype']} {' × '.join(map(str, feature['shape']))}{_entries(feature)}")
        if apart := document["failures"]:
            size = f"{apart['frames']} frames, {apart['bytes'] / 1e6:.1f} MB"
            print(f"  failed episodes apart, in {apart['folder']}: {apart['episodes']}, {size}")


@verbs.command()
def view(
    dataset: Dataset,
    png: Png = None,
    episode: Episode = 0,
) -> None:
    """Draw an episode: its pictures, states, actions and running leaves over time."""
    from bestman_bt.cli.dataset_picture import draw_episode

    with _refused():
        found = DatasetFolder.read(dataset)
        _check_episode(found, episode)
        target = png or Path(f"{dataset.resolve().name}_{episode}.png")
        draw_episode(found, episode, target)
    print(f"written: {target}")


@verbs.command()
def merge(
    datasets: Annotated[list[Path], typer.Argument(metavar="DIR…", help="Datasets of the same robot and features.")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="The new dataset; does not exist yet.")],
    as_json: Json = False,
) -> None:
    """Copy the episodes of several datasets into a new one, videos as they are."""
    with json_output(as_json) as print_json, _refused():
        if out.exists():
            raise ConfigurationError([Problem("--out", None, "", f"{out} exists already; name a new folder")])
        sources = [DatasetFolder.read(path) for path in datasets]
        first = sources[0]
        problems = [
            Problem(str(source.path), None, "", f"{difference} as in {first.path}")
            for source in sources[1:]
            for difference in first.differences(source)
        ]
        seen: dict[tuple[str, int], Path] = {}
        for source in sources:
            for key in _seeds(source):
                if key in seen:
                    why = f"has seed {key[1]} of {key[0]!r}, which {seen[key]} has too"
                    problems.append(Problem(str(source.path), None, "", why))
                seen.setdefault(key, source.path)
        if problems:
            raise ConfigurationError(problems)
        unfinished = out.with_name(f"{out.name}.unfinished")
        shutil.rmtree(unfinished, ignore_errors=True)
        merged = DatasetFolder(unfinished, first.fps, first.robot, first.features)
        for source in sources:
            merged.append(source)
        merged.path = unfinished.rename(out)
        print_json(_document(merged))
    if not as_json:
        print(f"{out}: {len(merged.episodes)} episodes of {len(sources)} datasets")


@verbs.command()
def replay(dataset: Dataset, episode: Episode = 0, as_json: Json = False) -> None:
    """Command the actions of an episode without feedback, in its scene with its seed, and judge the outcome."""
    from bestman_bt.evaluation.open_loop import replay_open_loop
    from bestman_bt.evaluation.result import Outcome

    with json_output(as_json) as print_json, _refused():
        found = DatasetFolder.read(dataset)
        _check_episode(found, episode)
        replayed = replay_open_loop(found, episode)
        result = replayed.result
        difference = {unit: {"entry": name, "value": value} for unit, (name, value) in replayed.difference.items()}
        refused = result.failure.why if result.tree_status != "SUCCESS" and result.failure is not None else ""
        document = {"episode": episode, "seed": result.seed, "goal": result.predicate, "ended_early": refused}
        print_json({**document, "difference": difference, "metrics": result.metrics})
    if not as_json:
        verdict = "was not judged" if result.predicate is None else "holds" if result.predicate else "does not hold"
        print(f"episode {episode}, seed {result.seed}: the goal {verdict}")
        if refused:
            print(f"  it ended early: {refused}")
        for unit, (name, value) in replayed.difference.items():
            print(f"  the last state differs by at most {value:.2g} {unit} ({name})")
    sys.exit(130 if result.outcome is Outcome.CANCELLED else 0 if result.predicate else 1)


def _check_episode(dataset: DatasetFolder, episode: int) -> None:
    if episode >= len(dataset.episodes):
        raise ConfigurationError(
            [Problem("--episode", None, "", f"should be below {len(dataset.episodes)}, got {episode}")]
        )


@contextmanager
def _refused() -> Iterator[None]:
    """Turn the errors of a dataset into wrong input."""
    try:
        yield
    except DatasetError as error:
        raise ConfigurationError([Problem("DIR", None, "", str(error))]) from error
    except OSError as error:
        raise ConfigurationError([Problem("DIR", None, "", f"cannot be read or written: {error}")]) from error


def _seeds(dataset: DatasetFolder) -> Iterator[tuple[str, int]]:
    """Yield task and seed of the episodes that name one."""
    return ((row["tasks"][0], row["seed"]) for row in dataset.episodes if row.get("seed") is not None)


def _read(path: Path) -> DatasetFolder:
    """Return the dataset of a folder; an empty one if ``collect`` has kept only failures."""
    from bestman_bt.evaluation.collection import ATTEMPTS

    if (path / "meta/info.json").exists() or not (path / ATTEMPTS).exists():
        return DatasetFolder.read(path)
    if not (path / FAILURES / "meta/info.json").exists():
        tried = (path / ATTEMPTS).read_bytes().count(b"\n")
        raise DatasetError(f"{path} holds no episodes: collect has tried {tried} seeds, which {ATTEMPTS} lists")
    failures = DatasetFolder.read(path / FAILURES)
    return DatasetFolder(path, failures.fps, failures.robot, failures.features)


def _document(dataset: DatasetFolder) -> dict[str, Any]:
    tasks = [
        {
            "task": task,
            "episodes": sum(task in row["tasks"] for row in dataset.episodes),
            "seeds": sorted(seed for of, seed in _seeds(dataset) if of == task),
        }
        for task in dataset.tasks
    ]
    apart = dataset.path / FAILURES
    failures = _document(DatasetFolder.read(apart)) if (apart / "meta/info.json").exists() else None
    size = sum(path.stat().st_size for path in dataset.path.rglob("*") if path.is_file())
    return {
        "folder": str(dataset.path),
        "robot": dataset.robot,
        "episodes": len(dataset.episodes),
        "frames": dataset.frames,
        "fps": dataset.fps,
        "bytes": size - (failures["bytes"] if failures else 0),
        "tasks": tasks,
        "features": dataset.features,
        "failures": failures,
    }


def _entries(feature: dict[str, Any]) -> str:
    names, units = entry_names(feature), feature.get("units")
    if not names or feature["dtype"] == "video":
        return ""
    if units is None:
        return f": {', '.join(names)}"
    return f": {', '.join(f'{name} [{unit}]' for name, unit in zip(names, units, strict=True))}"


def _ranges(numbers: list[int]) -> str:
    """Return sorted numbers as text, such as 1000 to 1007, 1009."""
    ranges: list[list[int]] = []
    for number in numbers:
        if ranges and number == ranges[-1][-1] + 1:
            ranges[-1][1:] = [number]
        else:
            ranges.append([number])
    return ", ".join(" to ".join(map(str, one)) for one in ranges)
