"""Refuses what is no usable OpenDRIVE text, in words, before the client's reader sees it.

The client's reader skips what it does not understand and dies of some of it; none of that tells a
user what to mend.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NoReturn

import numpy as np
import shapely
from lxml import etree
from numpy.typing import NDArray

MOST_ROADS = 20_000
MOST_ROAD_M = 5_000_000.0
"""Length of all roads together; every metre of every lane is looked at."""
FARTHEST_M = 1_000_000.0
"""From the origin. Positions are single-precision floats: there, they are 6 cm apart."""
HIGHEST_M = 10_000.0
"""Above or below 0; no road on Earth is there."""
WIDEST_M = 500.0
"""Of a lane."""
MOST_LANES = 1000
"""On one side of a road."""
SHARPEST_PER_M = 10.0
"""Curvature of an arc, or at an end of a spiral: a radius of 10 cm."""
_CLOSE_M = 1e-3
_LARGEST_ID = 2**32 - 1
_SHAPES = ("line", "arc", "spiral", "poly3", "paramPoly3")
_BENDS = {"arc": ("curvature",), "spiral": ("curvStart", "curvEnd")}
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


def root_of(opendrive: str) -> etree._Element:
    """The document, in the names that CARLA's reader sees: it knows no default namespace.

    Raises:
        etree.XMLSyntaxError, UnicodeEncodeError: it is no XML, or no UTF-8.
    """
    # The text is UTF-8 here, whatever encoding the file once had and still names.
    parser = etree.XMLParser(huge_tree=True, encoding="utf-8")
    root = etree.fromstring(opendrive.encode(), parser)
    if None in root.nsmap:
        for element in root.iter("{*}*"):
            if element.prefix is None:
                element.tag = etree.QName(element).localname
    return root


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
        root = root_of(opendrive)
    except UnicodeEncodeError as error:
        raise MapSamplingError(f"map {name}: it is no UTF-8 text: {error.reason}") from error
    except etree.XMLSyntaxError as error:
        raise MapSamplingError(f"map {name}: no well-formed XML: {error}") from error
    if root.tag != "OpenDRIVE":
        raise MapSamplingError(f"map {name}: the document is a <{root.tag}>, not an <OpenDRIVE>")
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
        if not 0 <= road_id <= _LARGEST_ID:
            raise MapSamplingError(
                f"map {name}: the road's id {road_id} is none that CARLA reads (0 to {_LARGEST_ID})"
            )
        _whole(name, road, "junction", where)
        whole_m += _checked_length(name, road, where)
        _check_course(name, road, where)
        _check_lanes(name, road, where)
    if whole_m > MOST_ROAD_M:
        raise MapSamplingError(
            f"map {name}: {whole_m / 1e3:.0f} km of road are too many for one town (at most "
            f"{MOST_ROAD_M / 1e3:.0f}); cut the map into pieces"
        )


def check_samples(name: str, samples: Mapping[str, NDArray[Any]]) -> None:
    """Looks for what no town can be made of, in what the client's reader made of a text.

    Args:
        name: the map's, for the message.
        samples: as ``carstage_sim.maps.opendrive.sample`` gives them.

    Raises:
        MapSamplingError: with the first place at fault and what is wrong with it.
    """
    for what, places in (("lane", samples["location"]), ("crosswalk", samples["crosswalk"])):
        reach = np.array([FARTHEST_M, FARTHEST_M, HIGHEST_M])
        bad = ~(np.abs(places) <= reach).all(axis=1)  # what is no number is bad, too
        if bad.any():
            where = _place(samples, bad) if what == "lane" else "a crosswalk"
            raise MapSamplingError(
                f"map {name}, {where}: it leads to {_numbers(places[bad][0])}, which is beyond "
                f"{FARTHEST_M / 1e3:g} km or {HIGHEST_M / 1e3:g} km of height; look at the "
                "geometry, elevation, offsets and outlines there"
            )
    bad = ~(np.abs(samples["width_m"]) <= WIDEST_M)
    if bad.any():
        raise MapSamplingError(
            f"map {name}, {_place(samples, bad)}: the lane is {samples['width_m'][bad][0]:g} m "
            f"wide (at most {WIDEST_M:g}); look at its <width>"
        )


def _place(samples: Mapping[str, NDArray[Any]], bad: NDArray[np.bool_]) -> str:
    row = int(np.argmax(bad))
    road, lane, s_m = (samples[key][row] for key in ("road_id", "lane_id", "s_m"))
    return f"road {road}, lane {lane}, s={s_m:.1f} m"


def _numbers(values: NDArray[np.float64]) -> str:
    return f"({', '.join(f'{value:g}' for value in values)})"


def _checked_length(name: str, road: etree._Element, where: str) -> float:
    length_m = _number(name, road, "length", where)
    if length_m <= 0.0:
        raise MapSamplingError(f"map {name}, {where}: its length is not above 0")
    return length_m


def _check_course(name: str, road: etree._Element, where: str) -> None:
    pieces = road.findall("planView/geometry")
    if not pieces:
        raise MapSamplingError(f"map {name}, {where}: it has no <planView><geometry>")
    before_m = -math.inf
    for piece in pieces:
        here = f"{where}, geometry"
        for attribute in ("s", "x", "y", "hdg", "length"):
            value = _number(name, piece, attribute, here)
            if abs(value) > FARTHEST_M:
                raise MapSamplingError(
                    f"map {name}, {here}: {attribute}={value:g} is beyond "
                    f"{FARTHEST_M / 1e3:g} km; move the map to its origin"
                )
        s_m = float(piece.get("s", ""))
        if s_m < before_m - _CLOSE_M or (piece is pieces[0] and s_m > _CLOSE_M):
            raise MapSamplingError(
                f"map {name}, {here}: s={s_m:g}: pieces begin at 0 and follow each other"
            )
        before_m = s_m
        _check_shape(name, piece, here)
    for part in ("elevationProfile/elevation", "lateralProfile/superelevation"):
        for polynomial in road.iterfind(part):
            _check_finite(name, polynomial, f"{where}, {part.partition('/')[2]}")


def _check_shape(name: str, piece: etree._Element, where: str) -> None:
    shapes = [shape for shape in piece if shape.tag in _SHAPES]
    if len(shapes) != 1:
        raise MapSamplingError(
            f"map {name}, {where}: it has {len(shapes)} of {', '.join(_SHAPES)}; CARLA reads one"
        )
    (shape,) = shapes
    _check_finite(name, shape, f"{where}, {shape.tag}")
    bends = [
        _number(name, shape, key, f"{where}, {shape.tag}") for key in _BENDS.get(str(shape.tag), ())
    ]
    if any(abs(bend) > SHARPEST_PER_M for bend in bends):
        raise MapSamplingError(
            f"map {name}, {where}, {shape.tag}: a curvature above {SHARPEST_PER_M:g} per metre"
        )
    if bends and bends[-1] == (bends[0] if len(bends) == 2 else 0.0):
        raise MapSamplingError(
            f"map {name}, {where}, {shape.tag}: CARLA divides by its curvature, or by the change "
            "of it, which is 0; write a <line/> or an <arc>"
        )


def _check_lanes(name: str, road: etree._Element, where: str) -> None:
    sections = road.findall("lanes/laneSection")
    if not sections:
        raise MapSamplingError(f"map {name}, {where}: it has no <lanes><laneSection>")
    for offset in road.iterfind("lanes/laneOffset"):
        _check_finite(name, offset, f"{where}, laneOffset")
    for section in sections:
        _number(name, section, "s", f"{where}, laneSection")
        for lane in section.iterfind("*/lane"):
            lane_id = _whole(name, lane, "id", f"{where}, lane")
            if abs(lane_id) > MOST_LANES:
                raise MapSamplingError(
                    f"map {name}, {where}: a lane's id is {lane_id} (at most {MOST_LANES})"
                )
            for width in lane.iterfind("width"):
                _check_finite(name, width, f"{where}, lane {lane_id}, width")


def _check_finite(name: str, element: etree._Element, where: str) -> None:
    """Refuse infinities and what is no number; words are 0 to CARLA's reader."""
    for attribute, text in element.attrib.items():
        try:
            finite = math.isfinite(float(text))
        except ValueError:
            continue
        if not finite:
            raise MapSamplingError(f"map {name}, {where}: {attribute}={text!r} is no number")


def _number(name: str, element: etree._Element, attribute: str, where: str) -> float:
    text = element.get(attribute)
    if text is None:
        _missing(name, attribute, where)
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise MapSamplingError(f"map {name}, {where}: {attribute}={text!r} is no number")
    return value


def _whole(name: str, element: etree._Element, attribute: str, where: str) -> int:
    text = element.get(attribute)
    if text is None:
        _missing(name, attribute, where)
    try:
        return int(text)
    except ValueError as error:
        raise MapSamplingError(
            f"map {name}, {where}: {attribute}={text!r} is no whole number, and CARLA reads no "
            "other; number the map's elements"
        ) from error


def _missing(name: str, attribute: str, where: str) -> NoReturn:
    raise MapSamplingError(f"map {name}, {where}: it has no {attribute}")
