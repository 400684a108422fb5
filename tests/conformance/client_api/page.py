"""The page of the documentation that says what of the client's API is served."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from carstage.releases import KNOWN
from client_api import playing  # noqa: F401 - the trials register themselves
from client_api.entries import Entry, Support, entries
from client_api.since import SINCE, UNTIL, names_of
from client_api.surface import surface

PAGE = Path(__file__).parents[3] / "docs" / "client-api-coverage.md"
"""Where the page is."""

_HEAD = """# Client API coverage

What the embedded simulator does with each name of the `carla` 0.9.16 client. The tests in `tests/conformance` go through everything
that `dir(carla)` shows. They call each name against a server and look at the effect; a name without a trial fails. They also compare
this page with their table. `pytest tests/conformance --write-table` writes the page.

- **works**: does what it does in CARLA; the sentence says what the trial sees.
- **limited**: answered, with the difference that the sentence states.
- **client-side**: lives in the client and needs no server; exercised all the same.

"""  # noqa: E501

_ORDER = (
    "Client", "World", "WorldSettings", "WeatherParameters", "WorldSnapshot", "Actor", "Vehicle",
    "Walker", "WalkerAIController", "TrafficLight", "TrafficManager", "command", "Map",
    "LightManager", "DebugHelper", "BlueprintLibrary", "Sensor",
)  # fmt: skip
"""Classes that stand first; the others follow by name."""


def api_page() -> str:
    """The whole page as Markdown."""
    names = surface()
    counts = dict.fromkeys(Support, 0)
    groups: dict[str, dict[int, list[str]]] = {}
    known = list(entries())
    for name in names:
        number, entry = _entry_of(known, name)
        if entry is None:
            continue
        counts[entry.support] += 1
        groups.setdefault(_group(name), {}).setdefault(number, []).append(name)
    lines = [_HEAD]
    lines.append(
        f"Of {len(names)} names {counts[Support.WORKS]} work, {counts[Support.LIMITED]} are limited"
        f" and {counts[Support.CLIENT_SIDE]} are client-side.\n"
    )
    for group in sorted(groups, key=lambda g: (_ORDER.index(g) if g in _ORDER else 99, g)):
        lines += [
            f"## {_title(group)}\n",
            "| names | | what is seen, or what differs |",
            "|---|---|---|",
        ]
        for number, members in groups[group].items():
            entry = known[number]
            short = ", ".join(f"`{_short(name)}`" for name in members)
            lines.append(f"| {short} | {entry.support.value} | {_escaped(entry.sentence)} |")
        lines.append("")
    lines += _versions()
    return "\n".join(lines).rstrip() + "\n"


def _entry_of(known: Sequence[Entry], name: str) -> tuple[int, Entry | None]:
    exact = [(k, e) for k, e in enumerate(known) if name in e.names]
    found = exact or [(k, e) for k, e in enumerate(known) if e.covers(name)]
    return found[0] if found else (-1, None)


def _group(name: str) -> str:
    return name.split(".")[0]


def _title(group: str) -> str:
    return f"carla.{group}"


def _short(name: str) -> str:
    first, _, rest = name.partition(".")
    return rest or first


def _escaped(sentence: str) -> str:
    return sentence.replace("|", "\\|").replace("``", "`")


def _versions() -> Iterator[str]:
    yield "## Older versions\n"
    yield (
        "With `--protocol` the server speaks to older clients, which lack these names (`.*`: the "
        "whole class):\n"
    )
    yield "| client | lacks |"
    yield "|---|---|"
    for version, names in SINCE.items():
        older = {"0.9.14": "0.9.13", "0.9.15": "0.9.13, 0.9.14", "0.9.16": "0.9.13 to 0.9.15"}
        yield f"| {older[version]} | {', '.join(f'`{name}`' for name in names)} |"
    yield "\nNames that later clients have no more:\n"
    yield "| client, and those before it | has |"
    yield "|---|---|"
    for version, names in UNTIL.items():
        yield f"| {version} | {', '.join(f'`{name}`' for name in names)} |"
    yield (
        "\nThe tests play the trials with each client's own wheel. Trials all of whose names it "
        "lacks are not played;\nothers leave out what it lacks.\n"
    )
    yield "| client | names | trials |"
    yield "|---|---|---|"
    for release in KNOWN:
        have = names_of(str(release), surface())
        played = sum(any(map(entry.covers, have)) for entry in entries())
        yield f"| {release} | {len(have)} | {played} |"
