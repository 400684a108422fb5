"""OpenDRIVE texts of a few roads, each about one thing that a map may have or lack."""

from __future__ import annotations

GEO_REFERENCE = "<![CDATA[+proj=tmerc +lat_0=49 +lon_0=8 +k=1 +x_0=0 +y_0=0 +datum=WGS84]]>"
_CITY_LANES = (("driving", 3.5), ("parking", 2.4), ("sidewalk", 3.0))


def road(
    road_id: int,
    x: float,
    y: float,
    heading: float,
    length: float,
    *,
    elevation: tuple[tuple[float, float, float, float, float], ...] = ((0, 0, 0, 0, 0),),
    lanes: tuple[tuple[str, float], ...] = (("driving", 3.5),),
    signals: str = "",
    objects: str = "",
) -> str:
    """A straight road; ``lanes`` are the kinds and widths of each side from the middle outwards."""

    def side(sign: int) -> str:
        numbered = [
            f'<lane id="{sign * number}" type="{kind}" level="false"><link/>'
            f'<width sOffset="0" a="{width}" b="0" c="0" d="0"/>'
            '<roadMark sOffset="0" type="solid" color="white" width="0.15"/></lane>'
            for number, (kind, width) in enumerate(lanes, start=1)
        ]
        return "".join(reversed(numbered) if sign > 0 else numbered)

    profile = "".join(
        f'<elevation s="{s}" a="{a}" b="{b}" c="{c}" d="{d}"/>' for s, a, b, c, d in elevation
    )
    return (
        f'<road name="" length="{length}" id="{road_id}" junction="-1"><link/><planView>'
        f'<geometry s="0" x="{x}" y="{y}" hdg="{heading}" length="{length}"><line/></geometry>'
        f"</planView><elevationProfile>{profile}</elevationProfile><lateralProfile/><lanes>"
        f'<laneSection s="0"><left>{side(1)}</left><center><lane id="0" type="none" '
        f'level="false"/></center><right>{side(-1)}</right></laneSection></lanes>'
        f"<objects>{objects}</objects><signals>{signals}</signals></road>"
    )


def document(*roads: str, geo_reference: str = GEO_REFERENCE, controllers: str = "") -> str:
    """A whole file."""
    return (
        '<?xml version="1.0" encoding="UTF-8"?><OpenDRIVE><header revMajor="1" revMinor="4" '
        'name="" version="1" date="" north="0" south="0" east="0" west="0">'
        f"<geoReference>{geo_reference}</geoReference></header>{''.join(roads)}{controllers}"
        "</OpenDRIVE>"
    )


def one_road() -> str:
    """A single road in the country: no junction, no sidewalk, no reference on the globe."""
    return document(road(1, 0, 0, 0, 200), geo_reference="")


def hill_road() -> str:
    """Rises by 6 m between 50 and 150 m, as a smooth S."""
    # 6 m * (3 u^2 - 2 u^3) with u = ds / 100 m.
    rise = (50, 0, 0, 18e-4, -12e-6)
    profile = ((0, 0, 0, 0, 0), rise, (150, 6, 0, 0, 0))
    return document(road(1, 0, 0, 0, 200, elevation=profile))


def crossing_on_two_levels() -> str:
    """A road along x, and one along y that crosses 6 m above it; each has a speed limit's sign."""
    up, down = (20, 0, 0, 6 * 3 / 80**2, -6 * 2 / 80**3), (100, 6, 0, 0, 0)
    over = (200, 6, 0, -6 * 3 / 80**2, 6 * 2 / 80**3)
    profile = ((0, 0, 0, 0, 0), up, down, over, (280, 0, 0, 0, 0))
    below = road(1, -150, 0, 0, 300, signals=_speed_limit(7, 60))
    signs = _speed_limit(8, 150)
    above = road(2, 0, -150, 1.5707963267948966, 300, elevation=profile, signals=signs)
    return document(below, above)


def parking_street() -> str:
    """A street with parking lanes and sidewalks."""
    return document(road(1, 0, 0, 0, 240, lanes=_CITY_LANES))


def _speed_limit(signal_id: int, s: float) -> str:
    return (
        f'<signal id="{signal_id}" name="" s="{s}" t="-6" zOffset="0" hOffset="0" roll="0" '
        'pitch="0" orientation="+" dynamic="no" country="OpenDRIVE" type="274" subtype="-1" '
        'value="60"><validity fromLane="-1" toLane="-1"/></signal>'
    )


def light(signal_id: int, s: float, lanes: tuple[int, int], t: float = -6.0) -> str:
    """A traffic light beside a road."""
    return (
        f'<signal id="{signal_id}" name="" s="{s}" t="{t}" zOffset="0" hOffset="0" roll="0" '
        'pitch="0" orientation="+" dynamic="yes" country="OpenDRIVE" type="1000001" subtype="-1" '
        f'value="-1"><validity fromLane="{lanes[0]}" toLane="{lanes[1]}"/></signal>'
    )
