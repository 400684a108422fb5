"""Refuses what is no usable OpenDRIVE text, in words, before the client's reader sees it.

The client's reader skips what it does not understand and dies of some of it; none of that tells a
user what to mend.
"""

from __future__ import annotations

import math

import shapely
from lxml import etree

MOST_ROADS = 20_000
MOST_ROAD_M = 5_000_000.0
"""Length of all roads together; every metre of every lane is looked at."""
FARTHEST_M = 1_000_000.0
"""From the origin. Positions are single-precision floats: there, they are 6 cm apart."""
GEOS = ((3, 13, 1), (3, 14, 1))
"""The libraries under shapely 2.1 and 2.2: those that were shown to draw the same towns."""


class MapSamplingError(RuntimeError):
    """Nothing can be made of an OpenDRIVE text; the message says why and what to do."""


def check_geometry_library() -> None:
    """Refuse to draw a town that may differ from those of its name elsewhere.

    Raises:
        MapSamplingError: nobody compared the towns of the GEOS under shapely.
    """
    if shapely.geos_version not in GEOS:
        found = ".".join(map(str, shapely.geos_version))
        known = " and ".join(".".join(map(str, version)) for version in GEOS)
        raise MapSamplingError(
            f"towns are drawn with GEOS {known}, which were shown to give the same triangles; "
            f"shapely {shapely.__version__} has {found}: pip install 'shapely>=2.1,<2.3'"
        )


def check_opendrive(name: str, opendrive: str) -> None:
    """Looks for what the reader cannot survive.

    Args:
        name: the map's, for the message.
        opendrive: the text.

    Raises:
        MapSamplingError: with the reason and the way out.
    """
    # Ten lines of entities that hold each other unfold into gigabytes.
    if "<!ENTITY" in opendrive:
        raise MapSamplingError(f"map {name}: it declares XML entities, which no map needs")
    try:
        # The text is UTF-8 here, whatever encoding the file once had and still names.
        parser = etree.XMLParser(huge_tree=True, encoding="utf-8")
        root = etree.fromstring(opendrive.encode(), parser)
    except UnicodeEncodeError as error:
        raise MapSamplingError(f"map {name}: it is no UTF-8 text: {error.reason}") from error
    except etree.XMLSyntaxError as error:
        raise MapSamplingError(f"map {name}: no well-formed XML: {error}") from error
    if etree.QName(root).localname != "OpenDRIVE":
        raise MapSamplingError(
            f"map {name}: the document is a <{etree.QName(root).localname}>, not an <OpenDRIVE>"
        )
    if etree.QName(root).namespace:
        raise MapSamplingError(
            f"map {name}: its elements are in the namespace {etree.QName(root).namespace}, which "
            "CARLA does not read; remove the xmlns attribute"
        )
    roads = root.findall("road")
    if not roads:
        raise MapSamplingError(f"map {name}: there is no <road> in it")
    if len(roads) > MOST_ROADS:
        raise MapSamplingError(
            f"map {name}: {len(roads)} roads are too many for one town (at most {MOST_ROADS}); cut "
            "the map into pieces"
        )
    seen: set[int] = set()
    whole_m = 0.0
    for road in roads:
        road_id = _whole(name, road, "id", "road")
        if road_id in seen:
            raise MapSamplingError(f"map {name}: two roads have the id {road_id}")
        seen.add(road_id)
        where = f"road {road_id}"
        _whole(name, road, "junction", where)
        length_m = _number(name, road, "length", where)
        if length_m <= 0.0:
            raise MapSamplingError(f"map {name}, {where}: its length is not above 0")
        whole_m += length_m
        pieces = road.findall("planView/geometry")
        if not pieces:
            raise MapSamplingError(f"map {name}, {where}: it has no <planView><geometry>")
        for piece in pieces:
            for attribute in ("s", "x", "y", "hdg", "length"):
                value = _number(name, piece, attribute, f"{where}, geometry")
                if abs(value) > FARTHEST_M:
                    raise MapSamplingError(
                        f"map {name}, {where}, geometry: {attribute}={value:g} is beyond "
                        f"{FARTHEST_M / 1e3:g} km; move the map to its origin"
                    )
        if road.find("lanes/laneSection") is None:
            raise MapSamplingError(f"map {name}, {where}: it has no <lanes><laneSection>")
        for lane in road.iterfind("lanes/laneSection/*/lane"):
            _whole(name, lane, "id", f"{where}, lane")
    if whole_m > MOST_ROAD_M:
        raise MapSamplingError(
            f"map {name}: {whole_m / 1e3:.0f} km of road are too many for one town (at most "
            f"{MOST_ROAD_M / 1e3:.0f}); cut the map into pieces"
        )


def _number(name: str, element: etree._Element, attribute: str, where: str) -> float:
    text = element.get(attribute)
    try:
        value = float(text) if text is not None else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise MapSamplingError(f"map {name}, {where}: {attribute}={text!r} is no number")
    return value


def _whole(name: str, element: etree._Element, attribute: str, where: str) -> int:
    text = element.get(attribute)
    try:
        return int(text) if text is not None else _missing(name, attribute, where)
    except ValueError as error:
        raise MapSamplingError(
            f"map {name}, {where}: {attribute}={text!r} is no whole number, and CARLA reads no "
            "other; number the map's elements"
        ) from error


def _missing(name: str, attribute: str, where: str) -> int:
    raise MapSamplingError(f"map {name}, {where}: it has no {attribute}")
