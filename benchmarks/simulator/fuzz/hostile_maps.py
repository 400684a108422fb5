"""OpenDRIVE texts that a server must refuse at once, and one that would keep it busy for long."""

from __future__ import annotations

import random

_ROAD = (
    '<road name="" length="{length}" id="{id}" junction="-1"><link/><planView><geometry s="0" '
    'x="{x}" y="{y}" hdg="0" length="{length}"><line/></geometry></planView><lanes><laneSection '
    's="0"><center><lane id="0" type="none" level="false"/></center><right><lane id="{lane}" '
    'type="driving" level="false"><link/><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
    "</right></laneSection></lanes></road>"
)


def _document(*roads: str, before: str = "") -> str:
    header = '<header revMajor="1" revMinor="4"/>'
    return f"<?xml version='1.0'?>{before}<OpenDRIVE>{header}{''.join(roads)}</OpenDRIVE>"


def _road(**changed: object) -> str:
    values: dict[str, object] = {"length": 100, "id": 1, "x": 0, "y": 0, "lane": -1}
    return _ROAD.format_map(values | changed)


def _unfolding() -> str:
    """Nine entities, each ten times the one before it: gigabytes once they are replaced."""
    lines = ['<!ENTITY e0 "unfolds">']
    for number in range(1, 10):
        lines.append(f'<!ENTITY e{number} "{f"&e{number - 1};" * 10}">')
    return _document("<road name='&e9;'/>", before=f"<!DOCTYPE OpenDRIVE [{''.join(lines)}]>")


REFUSED_MAPS = (
    "",
    "\0" * 1000,
    "<OpenDRIVE>" * 5000,
    "<a>" * 100_000,
    "<svg/>",
    _document(),
    _unfolding(),
    _document(_road(length="nan")),
    _document(_road(length="1e308")),
    _document(_road(length="-5")),
    _document(_road(x="1e30")),
    _document(_road(id="no number")),
    _document(_road(id=2**70), _road(id=2**70)),
    _document(_road(lane="1" * 5000)),
    _document(*(_road(id=number) for number in range(25_000))),
    "\udcff\udcfe",
)
"""Each is refused before anything is made of it."""


def large_map(rng: random.Random) -> str:
    """A map like no other before, of more roads than are baked in a minute."""
    return _document(
        *(_road(id=n, y=9 * n, length=round(rng.uniform(500, 900), 3)) for n in range(500))
    )
