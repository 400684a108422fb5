"""Towns and frames of this code under several Pythons: the same bytes in all of them?

Each Python has an installation of Car-STAGE of its own, with whatever versions of its dependencies.
Towns are baked anew in each. Where tables differ, the columns whose values differ are named.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.framework.recorded import hashes, record_demo
from carstage import Dataset
from carstage.bench.verdict import Figure, Verdict
from carstage.dataset.tables import read_table

TOWNS = ("Stage01", "Stage02", "Stage03")
SECONDS = 1.0
"""Of the demonstration: ten frames of eight sensors."""

_BAKE = """
import json, sys, tempfile
from pathlib import Path
from carstage_sim.maps import MapCatalogue
maps, names = json.loads(sys.argv[1])
with tempfile.TemporaryDirectory() as folder:
    catalogue = MapCatalogue([Path(path) for path in maps], {}, cache_folder=Path(folder))
    print(json.dumps({name: catalogue.load(name).digest for name in names}))
"""


def _digests(python: str, towns: Sequence[str]) -> dict[str, str]:
    """Digest of each town, baked by a Python; a town is a name or an OpenDRIVE file."""
    maps = [town for town in towns if town.endswith(".xodr")]
    names = [Path(town).stem if town in maps else town for town in towns]
    asked = json.dumps([maps, names])
    command = [python, "-c", _BAKE, asked]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    found: dict[str, str] = json.loads(done.stdout)
    return found


def _differing_values(one: Path, other: Path, names: Sequence[str]) -> list[str]:
    """Columns of tables whose values differ."""
    first, second = (Dataset(path).episodes[0].folder for path in (one, other))
    found = []
    for name in names:
        left, right = read_table(first / name), read_table(second / name)
        if left.column_names != right.column_names:
            found.append(f"{name}: columns")
            continue
        found += [
            f"{name}: {column}"
            for column in left.column_names
            if not left[column].equals(right[column])
        ]
    return found


def measure_same_bytes(
    others: Sequence[str],
    towns: Sequence[str] = TOWNS,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Bake and record in each Python, and compare with the one that runs this.

    Args:
        others: Pythons in whose environments Car-STAGE is installed.
        towns: names of built-in towns, and OpenDRIVE files.
        progress: called with the steps done and their total number.
    """
    pythons = (sys.executable, *others)
    total = 2 * len(pythons)
    baked, recorded, notes = [], [], []
    values: list[str] = []
    with tempfile.TemporaryDirectory(prefix="carstage-bytes-") as scratch:
        folders = [Path(scratch) / str(number) for number in range(len(pythons))]
        for number, python in enumerate(pythons):
            baked.append(_digests(python, towns))
            progress(2 * number + 1, total)
            recorded.append(hashes(record_demo(folders[number], SECONDS, python)))
            progress(2 * number + 2, total)
        tables = [name for name in recorded[0] if name.endswith(".parquet")]
        for folder in folders[1:]:
            values += _differing_values(folders[0], folder, tables)
    town_differences = [n for one in baked[1:] for n in one if one[n] != baked[0][n]]
    differing = [
        name
        for one in recorded[1:]
        for name in sorted({*one, *recorded[0]})
        if one.get(name) != recorded[0].get(name)
    ]
    notes += [f"town {name} differs" for name in town_differences]
    notes += [f"{name} differs" for name in [*values, *differing][:20]]
    files = [name for name in differing if not name.endswith(".parquet")]
    return Verdict(
        "same-bytes",
        (
            Figure("pythons", len(pythons), ">=", 2),
            Figure("towns_compared", len(towns) * len(others), ">=", 1),
            Figure("towns_that_differ", len(town_differences), "==", 0),
            Figure(
                "sensor_files_compared", (len(recorded[0]) - len(tables)) * len(others), ">=", 1
            ),
            Figure("sensor_files_that_differ", len(files), "==", 0),
            Figure("tables_compared", len(tables) * len(others), ">=", 1),
            Figure("columns_whose_values_differ", len(values), "==", 0),
            Figure("tables_whose_bytes_differ", len(differing) - len(files), "==", 0),
        ),
        notes,
    )
