"""``carstage split``: which episodes are for training, validation and test."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from carstage.cli.output import Debug, Json, command, dataset_address, note, result, result_json

if TYPE_CHECKING:
    from carstage.dataset import StoredSplits


@command
def split(
    dataset: Annotated[
        Path,
        typer.Argument(
            metavar="DATASET", help="Folder or address of the dataset.", callback=dataset_address
        ),
    ],
    val: Annotated[float, typer.Option("--val", help="Share of the episodes: validation.")] = 0.0,
    test: Annotated[float, typer.Option("--test", help="Share of the episodes: test.")] = 0.0,
    seed: Annotated[int, typer.Option("--seed", help="Another one gives another draw.")] = 0,
    stratify: Annotated[
        str,
        typer.Option(
            "--stratify",
            metavar="map,weather",
            help="Give each split its share of every map, weather preset, or both.",
        ),
    ] = "",
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Draw anew where splits are stored already.")
    ] = False,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Divide the episodes into train, val and test; exports and readers use what is stored."""
    del debug
    from carstage.dataset import SplitRule, split_dataset
    from carstage.errors import BadInputError

    if val == test == 0.0:
        raise BadInputError("Neither --val nor --test is given.", "Give --val 0.2 --test 0.1.")
    criteria: Any = tuple(name.strip() for name in stratify.split(",") if name.strip())
    rule = SplitRule(val, test, seed, criteria)
    stored = split_dataset(dataset, rule, overwrite=overwrite)
    counts = _counts(stored)
    if json:
        result_json({"path": str(dataset / "splits.json"), "episodes": counts})
    else:
        shown = ", ".join(f"{name} {number}" for name, number in counts.items())
        result(f"{dataset / 'splits.json'}: {shown}")
    note("Episodes that are recorded later have their split by the same seed and shares.")


def _counts(stored: StoredSplits) -> dict[str, int]:
    """Episodes by split, of the splits that were asked for."""
    found = Counter(stored.episodes.values())
    return {name: found[name] for name in stored.rule.wanted}
