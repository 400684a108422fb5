"""``carstage catalog``: an index over datasets, in SQLite or PostgreSQL."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from decimal import Decimal
from typing import TYPE_CHECKING, Annotated, Any

import typer

from carstage.cli.output import Debug, Json, command, note, result, result_json
from carstage.errors import BadInputError

if TYPE_CHECKING:
    from carstage.catalog import Catalog, PageFilter
    from carstage.dataset import Dataset as OpenDataset

catalog_app = typer.Typer(
    help="Index datasets: list, show, query, rebuild, verify, and remove what is left over.",
    no_args_is_help=True,
)

_MOST_ROWS = 100
_AGE = re.compile(r"([0-9]+(?:\.[0-9]+)?)([smhd])")
_UNIT_S = {"s": 1.0, "m": 60.0, "h": 3600.0, "d": 86400.0}

Dataset = Annotated[str, typer.Argument(metavar="DATASET", help="Folder or URL of the dataset.")]
Url = Annotated[
    str | None,
    typer.Option(
        "--catalog",
        metavar="URL",
        help="postgresql://USER@HOST/DATABASE or an SQLite file. Default: CARSTAGE_CATALOG, "
        "else the dataset's own file.",
    ),
]
Town = Annotated[str | None, typer.Option("--town", help="Only episodes on this map.")]
Weather = Annotated[str | None, typer.Option("--weather", help="Only with this weather preset.")]
SplitName = Annotated[str | None, typer.Option("--split", help="Only of train, val or test.")]
SensorKind = Annotated[str | None, typer.Option("--sensor", help="Only with a sensor of the kind.")]
Variant = Annotated[str | None, typer.Option("--variant", help="Only of the variant.")]
Label = Annotated[str | None, typer.Option("--class", help="Only with an object of the class.")]


@catalog_app.command("rebuild")
@command
def rebuild(
    dataset: Dataset,
    catalog: Url = None,
    update: Annotated[
        bool, typer.Option("--update", help="Read only episodes that are new or have changed.")
    ] = False,
    labels: Annotated[
        bool, typer.Option("--labels", help="Also copy the label tables (PostgreSQL only).")
    ] = False,
    json: Json = False,
    debug: Debug = False,
) -> int:
    """Write a dataset into the catalog, from its markers and files."""
    del debug
    from carstage import catalog as catalogs
    from carstage.cli.progress import watch_steps

    opened, place = _open(dataset, catalog, create=True)
    with opened:
        with watch_steps("Indexing", "episodes") as progress:
            summary = catalogs.rebuild(opened, place, update=update, progress=progress)
        document: dict[str, Any] = {"catalog": opened.address.shown, **summary.to_json()}
        if labels:
            document["label_rows"] = _load_labels(opened, place)
    for episode_id, reason in summary.problems.items():
        note(f"Episode {episode_id} is not in the catalog: {reason}")
    if json:
        result_json(document)
    else:
        result(
            f"{opened.address.shown}: {_count(summary.episodes, 'episode')}, "
            f"{summary.written} written, "
            f"{summary.removed} removed"
        )
    return 1 if summary.problems else 0


@catalog_app.command("load-labels")
@command
def load_labels(
    dataset: Dataset, catalog: Url = None, json: Json = False, debug: Debug = False
) -> None:
    """Copy the label tables of all episodes into PostgreSQL."""
    del debug
    opened, place = _open(dataset, catalog, create=True)
    with opened:
        rows = _load_labels(opened, place)
    if json:
        result_json({"catalog": opened.address.shown, "label_rows": rows})
    else:
        result(f"{opened.address.shown}: {rows} rows of labels")


@catalog_app.command("list")
@command
def list_(
    dataset: Annotated[
        str | None,
        typer.Argument(metavar="[DATASET]", help="Left out: all datasets of the catalog."),
    ] = None,
    catalog: Url = None,
    town: Town = None,
    weather: Weather = None,
    split: SplitName = None,
    sensor: SensorKind = None,
    variant: Variant = None,
    label: Label = None,
    limit: Annotated[int, typer.Option("--limit", min=1, max=10_000, help="Of a page.")] = 50,
    after: Annotated[int, typer.Option("--after", min=0, help="The page after this one.")] = 0,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """List episodes, page by page."""
    del debug
    from carstage import catalog as catalogs

    wanted = catalogs.PageFilter(town, weather, split, sensor, variant, label)
    location = None
    if dataset is None:
        opened = _open_all(catalog)
    else:
        opened, place = _open(dataset, catalog)
        location = _location(opened, place)
    with opened:
        page = catalogs.list_episodes(opened, location, wanted, limit=limit, after=after)
    if json:
        result_json({"episodes": page.episodes, "after": page.after})
        return
    shown = ["episode_id", "map", "weather", "split", "frames", "files", "bytes"]
    if location is None:
        shown.insert(0, "dataset")
    _print_rows(shown, ([row[name] for name in shown] for row in page.episodes))
    if page.after is not None:
        note(f"There are more: --after {page.after}")


@catalog_app.command("show")
@command
def show(
    dataset: Dataset,
    episode: Annotated[str, typer.Argument(metavar="EPISODE", help="Its id.")],
    catalog: Url = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Show all that the catalog knows of an episode."""
    del debug
    from carstage import catalog as catalogs

    opened, place = _open(dataset, catalog)
    with opened:
        found = catalogs.show_episode(opened, _location(opened, place), episode)
    if json:
        result_json(found)
        return
    lists = {name: found.pop(name) for name in ("sensors", "artifacts", "labels")}
    tried = found.pop("attempts")
    width = max(map(len, found))
    for name, value in found.items():
        result(f"{name:<{width}}  {_text(value)}")
    result(f"{'attempts':<{width}}  {', '.join(f'{a} {state}' for a, state in tried.items())}")
    for name, rows in lists.items():
        if rows:
            result(f"\n{name}")
            _print_rows(list(rows[0]), (list(row.values()) for row in rows))


@catalog_app.command("query")
@command
def query(
    dataset: Dataset,
    sql: Annotated[str, typer.Argument(metavar="SQL", help="A SELECT.")],
    catalog: Url = None,
    town: Town = None,
    weather: Weather = None,
    split: SplitName = None,
    sensor: SensorKind = None,
    variant: Variant = None,
    label: Label = None,
    index: Annotated[
        bool,
        typer.Option("--index", help="Ask the catalog's own tables, not those of the episodes."),
    ] = False,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Ask the label tables of a dataset's episodes in SQL, and say how much was read."""
    del debug
    from carstage import catalog as catalogs

    wanted = catalogs.PageFilter(town, weather, split, sensor, variant, label)
    read: Mapping[str, Any] = {}
    if index:
        if not wanted.is_empty:
            raise BadInputError(
                "--index asks the tables as they are: filters do not apply to it.",
                "Write the condition into the SQL, or leave --index out.",
            )
        opened, _ = _open(dataset, catalog)
        with opened:
            table = catalogs.query_catalog(opened, sql)
    else:
        answer = _ask_labels(dataset, catalog, sql, wanted)
        table = answer.table
        read = {"files": answer.files, "bytes_read": answer.bytes_read}
    names = _distinct(table.column_names)
    rows = list(zip(*(column.to_pylist() for column in table.columns), strict=True))
    if json:
        named = [dict(zip(names, map(_plain, row), strict=True)) for row in rows]
        result_json({"columns": names, "rows": named, **read})
        return
    _print_rows(names, rows[:_MOST_ROWS])
    if len(rows) > _MOST_ROWS:
        note(f"and {len(rows) - _MOST_ROWS} more rows; --json has all")
    if read.get("bytes_read") is not None:
        from carstage.runs import size_text

        note(f"Read {size_text(read['bytes_read'])} of {read['files']} files.")


@catalog_app.command("verify")
@command
def verify(
    dataset: Dataset,
    catalog: Url = None,
    deep: Annotated[
        bool, typer.Option("--deep", help="Read every file and compare its hash.")
    ] = False,
    json: Json = False,
    debug: Debug = False,
) -> int:
    """Compare the catalog with the markers, and the markers with the files."""
    del debug
    from carstage import catalog as catalogs
    from carstage.cli.progress import watch_steps

    opened, place = _open(dataset, catalog)
    with opened, watch_steps("Verifying", "episodes") as progress:
        found = list(catalogs.verify(opened, place, deep=deep, progress=progress))
    for one in found[:_MOST_ROWS]:
        note(f"{one.kind}: episode {one.episode_id}: {one.message}")
    if len(found) > _MOST_ROWS:
        note(f"and {len(found) - _MOST_ROWS} more; --json has all")
    if json:
        result_json({"ok": not found, "differences": [one.to_json() for one in found]})
    else:
        result(f"{_count(len(place.episodes), 'episode')}: {_count(len(found), 'difference')}")
    return 1 if found else 0


@catalog_app.command("gc")
@command
def collect_garbage(
    dataset: Dataset,
    older_than: Annotated[
        str | None,
        typer.Option(
            "--older-than",
            metavar="AGE",
            help="Also attempts without a marker that nobody has written to for AGE, as 12h or 7d.",
        ),
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Remove them; else they are listed.")] = False,
    json: Json = False,
    debug: Debug = False,
) -> int:
    """List or remove attempts that are no episode; a committed one is never removed."""
    del debug
    from carstage import catalog as catalogs
    from carstage.dataset import Dataset as OpenDataset
    from carstage.runs import held_attempts, size_text, work_folder
    from carstage.storage import open_store

    age_s = None if older_than is None else _age_s(older_than)
    place = OpenDataset(dataset)
    store = open_store(place.path)
    held = held_attempts(work_folder(place.path, None), store)
    found = list(catalogs.leftovers(store, older_than_s=age_s, held=held))
    kept = catalogs.collect(store, found) if yes else {}
    for leftover, reason in kept.items():
        note(f"{leftover.episode_id}/{leftover.attempt} stays: {reason}")
    size = size_text(sum(one.bytes for one in found if one not in kept))
    if json:
        removed = len(found) - len(kept) if yes else 0
        rows = [one.to_json() for one in found]
        result_json({"attempts": rows, "removed": removed, "kept": len(kept)})
        return 1 if kept else 0
    if found:
        rows = [one.to_json() for one in found]
        _print_rows(list(rows[0]), (list(row.values()) for row in rows))
    count = f"{_count(len(found) - len(kept), 'attempt')}, {size}"
    end = "removed" if yes else "--yes removes them"
    result(f"{count}: {end}" if found else "Nothing is left over.")
    return 1 if kept else 0


def _open(dataset: str, url: str | None, *, create: bool = False) -> tuple[Catalog, OpenDataset]:
    """The dataset, and its catalog."""
    from carstage.catalog import Catalog, catalog_address
    from carstage.dataset import Dataset as OpenDataset

    place = OpenDataset(dataset)
    return Catalog(catalog_address(url, place.path), create=create), place


def _open_all(url: str | None) -> Catalog:
    """The catalog of all datasets."""
    from carstage.catalog import Catalog, catalog_address

    return Catalog(catalog_address(url), create=False)


def _location(catalog: Catalog, dataset: OpenDataset) -> str:
    from carstage.catalog.address import location_of

    return location_of(dataset.path, catalog.address)


def _load_labels(catalog: Catalog, dataset: OpenDataset) -> int:
    from carstage import catalog as catalogs
    from carstage.cli.progress import watch_steps

    with watch_steps("Loading labels", "episodes") as progress:
        return catalogs.load_labels(catalog, dataset, progress=progress)


def _ask_labels(dataset: str, url: str | None, sql: str, wanted: PageFilter) -> Any:
    import atexit
    import gc

    # DuckDB reports objects that are still there at the end as a leak; see ``carstage.cli.main``.
    atexit.unregister(gc.freeze)
    if wanted.is_empty:  # then no catalog is needed
        from carstage.dataset import Dataset as OpenDataset
        from carstage.dataset.querying import query_episodes

        return query_episodes([one.tables for one in OpenDataset(dataset).episodes], sql)
    from carstage.catalog import query_labels

    opened, place = _open(dataset, url)
    with opened:
        return query_labels(place, sql, catalog=opened, wanted=wanted)


def _age_s(text: str) -> float:
    found = _AGE.fullmatch(text)
    if found is None:
        raise BadInputError(
            f"older-than: {text!r} is no age.", "Write a number with s, m, h or d, such as 7d."
        )
    return float(found[1]) * _UNIT_S[found[2]]


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' * (number != 1)}"


def _distinct(names: Sequence[str]) -> list[str]:
    """Names of columns; of equal ones, as a join gives them, the later ones are numbered."""
    found: list[str] = []
    for name in names:
        numbered = (f"{name}_{number}" for number in itertools.count(1))
        free = (one for one in numbered if one not in names and one not in found)
        found.append(name if name not in found else next(free))
    return found


def _plain(value: Any) -> Any:
    """A value as JSON has it: numbers stay numbers, and what is none there is null."""
    if isinstance(value, Decimal):
        return int(value) if value == value.to_integral_value() else float(value)
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def _print_rows(names: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Aligned columns on stdout."""
    lines = [list(names), *([_text(value) for value in row] for row in rows)]
    widths = [max(len(line[place]) for line in lines) for place in range(len(names))]
    for line in lines:
        cells = (cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        result("  ".join(cells).rstrip())


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
