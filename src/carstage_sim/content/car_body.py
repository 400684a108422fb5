"""A closed vehicle body by lofting: sections along the length, materials by where a face lies.

One class makes sedans, vans and buses of a :class:`BodyShape`. Lengths run from -1 (rear) to 1
(front) along x, heights from 0 (ground) to 1 (roof).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from carstage_sim.content.body_shape import BodyFrame, BodyShape, Points
from carstage_sim.content.lofting import Array, Curve, ShapeBuilder, uniform
from carstage_sim.mesh import Material

Outline = Sequence[tuple[float, float, float]]
"""Columns of a panel: share of the half width (beyond 1: round the corner), z from, z to."""


_NOSE_RISE_M, _TAIL_RISE_M = 0.07, 0.15
"""How much higher than the sills a bumper's lower edge is: tyres show below it."""
_FLARE_M = 0.07
"""Width of the bare plastic round a wheel arch."""
_TUCK_M = 0.08
"""How far sills stand in below the doors."""
_ASIDE = 2e-3
"""Relative distance of the points from whose places a direction of the skin is taken."""
COWL = 0.022
"""Length of the dark strip at the windscreen's foot, relative."""
_HOLLOW_M = 0.022
"""How far a door stands in between its shoulder and the sill."""
_ROOF_EDGE_M, _A_PILLAR_M, _FADE = 0.035, 0.015, 0.10
"""Painted edge of the roof, what a pillar beside the windscreen is wider, and the length, relative,
within which pillars beside the rear window become the roof's edge."""
_HALF_PILLAR_M = 0.04
"""Half width of a pillar between side windows."""
_LEAST_CABIN = 0.10
"""Rise over the belt, a share of the height, from which there is a cabin and no bonnet or boot."""
_MOST_ASIDE_M = 0.015
"""How far a plate that goes round a corner stands off the side at most."""
_COLUMN, _SIDE_COLUMN, _ROW = 0.15, 0.08, 0.07
"""Widest quads of a panel: on a face, round its corner (shares of the half width), and tallest."""


_ENDS = (-0.985, -0.96, -0.93, 0.90, 0.93, 0.96, 0.985)
_COARSE_ENDS = (-0.985, -0.94, 0.92, 0.985)
"""Sections near both ends, where a body is rounded."""

_FLAT = ((0.94, 0.86), (0.90, 0.99), (0.62, 1.0), (0.34, 1.0), (0.0, 1.0))
"""Section over a faceted bonnet: share of the half width, share of the rise over the belt."""


def _vault(foot: float) -> Points:
    """Section over a bonnet, flat up to the shoulders at the windscreen's ``foot``."""
    beside = (foot + 0.95) / 2
    return ((0.95, 0.20), (beside, 0.52), (foot, 0.68), (0.55 * foot, 0.93), (0.0, 1.0))


def _refined(outline: Outline) -> Outline:
    """The same outline with columns so close that a plate does not sink into a curved face."""
    columns = np.array(outline)
    at = [columns[:1]]
    for before, after in pairwise(columns):
        beyond = max(abs(before[0]), abs(after[0])) > 1.0
        count = int(np.ceil(abs(after[0] - before[0]) / (_SIDE_COLUMN if beyond else _COLUMN)))
        at.append(before + (after - before) * np.linspace(0.0, 1.0, max(count, 1) + 1)[1:, None])
    refined: list[tuple[float, float, float]] = [tuple(c) for c in np.concatenate(at).tolist()]
    return refined


class CarBody:
    """A lofted body.

    Args:
        shape: the outline.
        frame: where and how large.
        coarse: whether to do with fewer sections.
    """

    # Columns of a half section, from the middle of the floor over the side to the roof's middle.
    ARCH, LIP, SILL, BELT, GLASS, RAIL, ROOF, MIDDLE = 2, 3, 4, 8, 9, 10, 11, 13

    def __init__(self, shape: BodyShape, frame: BodyFrame, *, coarse: bool = False) -> None:
        self.shape, self.frame, self._coarse = shape, frame, coarse
        self._top, self._belt = Curve(shape.top), Curve(shape.belt)
        self._width = Curve(shape.width)
        self._sections: dict[float, Array] = {}

    def stations(self) -> Array:
        """Relative x of the sections: even ones, feature edges, and arches in fine steps."""
        s, f = self.shape, self.frame
        edges = [*s.rear_window, *s.windscreen, *s.side_glass, -1.0, 1.0]
        edges.append(s.windscreen[1] + COWL)
        for pillar, half_pillar, _ in self._pillars():
            edges += [pillar - half_pillar, pillar + half_pillar]
        for axle in f.axles:
            middle = (axle - f.center_x) / f.half_length
            edges += [
                middle + np.cos(a) * self._arch_radius / f.half_length
                for a in np.linspace(0.0, np.pi, 7 if self._coarse else 11)
            ]
            # The floor meets the arch in a step.
            past = (self._arch_radius + 0.004) / f.half_length
            edges += [middle - past, middle + past]
        edges += _COARSE_ENDS if self._coarse else _ENDS
        edges = [x for x in edges if -1.0 <= x <= 1.0]
        count, apart = (12, 0.06) if self._coarse else (23, 0.03)
        even = [x for x in np.linspace(-1, 1, count) if min(abs(x - e) for e in edges) > apart]
        stations: Array = np.unique(np.round([*edges, *even], 4))
        return stations

    def _pillars(self) -> list[tuple[float, float, Material]]:
        """Relative x, relative half width and material of the pillars between side windows."""
        s, f = self.shape, self.frame
        pillars = [(x, _HALF_PILLAR_M / f.half_length, s.pillar) for x in s.pillars]
        if s.quarter:
            pillars[0] = (s.pillars[0], s.quarter / f.half_length, Material.PAINT)
        return pillars

    @property
    def _arch_radius(self) -> float:
        return self.frame.wheel_radius * 1.13

    def section(self, x: float) -> Array:
        """``(14, 2)`` y, z of the half section at relative ``x``, metres; not to be written to."""
        if x not in self._sections:
            self._sections[x] = self._new_section(x)
        return self._sections[x]

    def _pillar_width(self, x: float) -> float:
        """How far the edges of windscreen, roof and rear window stand in from the roof's side."""
        s = self.shape
        if s.faceted:
            return _ROOF_EDGE_M
        ahead = _A_PILLAR_M * (x > s.windscreen[0] - 0.02)
        lower, upper = s.rear_window
        behind = float(np.clip((upper + _FADE - x) / _FADE, 0.0, 1.0)) if lower >= -1.0 else 0.0
        return _ROOF_EDGE_M + ahead + s.rear_pillar * behind

    def _new_section(self, x: float) -> Array:
        s, f = self.shape, self.frame
        height = f.height
        top, belt = float(self._top(x)) * height, float(self._belt(x)) * height
        w = float(self._width(x)) * f.half_width
        floor = self.floor(x)
        arch = floor
        for axle in f.axles:
            away = f.center_x + x * f.half_length - axle
            if abs(away) < self._arch_radius:
                arch = max(arch, f.wheel_radius + np.sqrt(self._arch_radius**2 - away**2))
        arch = min(arch, belt - 0.12)
        inner = max(f.half_width - f.tyre_width - 0.06, 0.3 * w)
        rise = max(top - belt, 0.01)
        house = np.clip((rise / height - 0.09) / 0.14, 0.0, 1.0)
        house = house * house * (3 - 2 * house)
        roof = w - s.tumblehome * f.half_width * min(rise / (0.36 * height), 1.15)
        flank = arch + 0.40 * (belt - arch)
        if s.cladding and not s.faceted:
            # The edge of bare plastic runs along the sills and round the arches.
            flank = min(max(s.cladding * height, arch + _FLARE_M), flank)
        # Sills curve in under the doors; over arches and at bumpers the side goes straight down.
        tucked = max(1.0 - (arch - floor) / _TUCK_M, 0.0) * min(
            max((0.80 - abs(x)) / 0.1, 0.0), 1.0
        )
        tucked *= not s.faceted
        # Doors are hollow below the shoulder, the line along which the body is widest.
        hollow = _HOLLOW_M * tucked
        side = [
            (min(inner, w * 0.9), floor),
            (min(inner, w * 0.9), arch),
            (w * 0.955 - _TUCK_M * tucked, arch),
            (w * 0.985 - 0.3 * _TUCK_M * tucked, arch + 0.02 + 0.6 * _TUCK_M * tucked),
            (w * 1.0 - hollow, flank),
            (w * 1.0, arch + 0.70 * (belt - arch)),
            (w * 0.980, arch + 0.88 * (belt - arch)),
            (w * 0.950, belt),
        ]
        # Over the bonnet the section is a flat vault, in the cabin windows and a roof.
        vault = _FLAT if s.faceted else _vault(s.screen_foot)
        cabin = [
            (w * 0.925, belt + 0.012),
            (roof + 0.10 * (w - roof), belt + 0.88 * rise),
            (roof - self._pillar_width(x), belt + 0.965 * rise),
            (roof * 0.5, belt + 0.995 * rise),
            (0.0, top),
        ]
        upper = [
            (
                (1 - house) * w * share + house * y,
                (1 - house) * (belt + rise * lift) + house * z,
            )
            for (share, lift), (y, z) in zip(vault, cabin, strict=True)
        ]
        return np.array([(0.0, floor), *side, *upper])

    def place(self, x: Array, y: Array, z: Array) -> Array:
        """Points of the vehicle's frame from relative x and metric y, z: rounds both ends."""
        s, f = self.shape, self.frame
        across = np.clip(np.abs(y) / f.half_width, 0.0, 1.0)
        front = np.clip((x - 0.60) / 0.40, 0.0, 1.0) ** 2
        rear = np.clip((-x - 0.66) / 0.34, 0.0, 1.0) ** 2
        lift = z / f.height - 0.34
        back = front * (
            s.nose_round * across**2.6 + s.nose_lean * np.clip(lift / 0.25, -0.5, 3.0) ** 2
        ) - rear * (s.tail_round * across**2.8 + s.tail_lean * np.clip(lift / 0.25, -0.5, 3.0) ** 2)
        return np.stack([f.center_x + x * (f.half_length - 0.025) - back, y, z], axis=-1)

    def add_to(self, builder: ShapeBuilder) -> None:
        """Add the skin with its windows; :mod:`carstage_sim.content.car_trim` adds the rest."""
        x = self.stations()
        half = np.stack([self.section(station) for station in x])
        along = self._leaning(x, half)
        full = np.concatenate([half[:, ::-1] * [-1.0, 1.0], half[:, 1:]], axis=1)
        points = self.place(
            np.concatenate([along[:, ::-1], along[:, 1:]], axis=1), full[..., 0], full[..., 1]
        )
        crease = 8.0 if self.shape.faceted else 40.0
        builder.grid(points, self._materials(x, half), crease_deg=crease)
        self._add_face(builder, half[-1], 1.0)
        self._add_face(builder, half[0], -1.0)

    def _leaning(self, x: Array, half: Array) -> Array:
        """Relative x of each point of the sections, whose windows' upper ends are moved along."""
        along = np.repeat(x[:, None], half.shape[1], axis=1)
        if self.shape.leans:
            away = np.interp(x, *np.array(self.shape.leans).T)
            for k in np.flatnonzero(away):
                along[k, self.RAIL] += away[k]
                half[k, self.RAIL] = self.section(float(along[k, self.RAIL]))[self.RAIL]
        return along

    def _materials(self, x: Array, half: Array) -> NDArray[np.uint8]:
        """Material of each quad between stations and columns."""
        s, f = self.shape, self.frame
        middle = (x[:-1] + x[1:]) / 2
        quads = uniform(Material.PAINT, len(middle), half.shape[1] - 1)
        quads[:, : self.LIP] = Material.PLASTIC_DARK
        lip = (half[:-1, self.SILL, 1] + half[1:, self.SILL, 1]) / 2
        ends = (np.abs(middle) > 0.8) & (lip < (s.clearance + 0.12) * f.height)
        raised = (lip > (s.clearance + 0.04) * f.height) & ~ends
        quads[raised, self.LIP] = Material.PLASTIC_DARK
        for column in range(self.LIP, self.BELT):
            low = (half[:-1, column + 1, 1] + half[1:, column + 1, 1]) / 2
            quads[low < s.cladding * f.height + 1e-6, column] = Material.PLASTIC_DARK
        if s.cladding and not s.faceted:
            quads[:, self.SILL] = Material.PLASTIC_DARK
        rise = (half[:-1, self.MIDDLE, 1] + half[1:, self.MIDDLE, 1]) / 2 - (
            half[:-1, self.BELT, 1] + half[1:, self.BELT, 1]
        ) / 2
        cabin = rise > _LEAST_CABIN * f.height
        quads[cabin & (middle < s.windscreen[0]), self.GLASS :] = s.roof
        glazed = cabin & (middle > s.side_glass[0]) & (middle < s.side_glass[1])
        quads[glazed, self.GLASS] = Material.GLASS
        if s.pillars:
            quads[glazed & (middle < max(s.pillars)), self.GLASS] = s.rear_pane
        for pillar, half_pillar, material in self._pillars():
            quads[glazed & (np.abs(middle - pillar) < half_pillar), self.GLASS] = material
        screen = (middle > s.windscreen[0]) & (middle < s.windscreen[1])
        back = (middle > s.rear_window[0]) & (middle < s.rear_window[1])
        quads[screen, self.ROOF :] = Material.GLASS
        quads[back, self.ROOF :] = s.rear_pane
        cowl = (middle > s.windscreen[1]) & (middle < s.windscreen[1] + COWL)
        quads[cowl, self.ROOF :] = Material.PLASTIC_DARK
        return np.concatenate([quads[:, ::-1], quads], axis=1)

    def _add_face(self, builder: ShapeBuilder, half: Array, end: float) -> None:
        """Close an end: rows between the section's left and right side."""
        share = np.linspace(-1.0, 1.0, 7 if self._coarse else 11)
        rows = uniform(Material.PAINT, len(half) - 2, len(share) - 1)
        rows[:2] = Material.PLASTIC_DARK
        if half[self.MIDDLE, 1] - half[self.BELT, 1] > _LEAST_CABIN * self.frame.height:
            rows[self.GLASS - 1 :] = self.shape.roof
        half = rim = half[1:]
        if end < 0 and self.shape.rear_glass is not None:
            half, share, rows = self._with_opening(half, share, rows, self.shape.rear_glass)
        y = half[:, :1] * share
        z = np.repeat(half[:, 1:], len(share), axis=1)
        # The middle of the roof is one point: the last row shrinks to it.
        points = self.place(np.full_like(y, end), y, z)
        if half is not rim:
            # The sides have no points where rows were added: no gap opens between the two.
            ends = self.place(np.full(len(rim), end), rim[:, 0], rim[:, 1])[:, 0]
            points[:, [0, -1], 0] = np.interp(half[:, 1], rim[:, 1], ends)[:, None]
        builder.grid(points if end < 0 else points[:, ::-1], rows)

    def _with_opening(
        self,
        half: Array,
        share: Array,
        rows: NDArray[np.uint8],
        glass: tuple[float, float, float],
    ) -> tuple[Array, Array, NDArray[np.uint8]]:
        """A face's sections, columns and materials with a pane between more of both.

        Args:
            half: ``(R, 2)`` y, z of the rows.
            share: ``(C,)`` of the half width.
            rows: ``(R - 1, C - 1)`` materials.
            glass: z from, z to (shares of the height), half width as a share.
        """
        sill, lintel, wide = glass
        # At the foot several points stand at one height.
        rising = np.append(np.diff(half[:, 1]) > 0.0, True)
        half, rows = half[rising], rows[rising[:-1]]
        levels = np.array([sill, lintel]) * self.frame.height
        z = np.unique(np.concatenate([half[:, 1], levels]))
        columns = np.unique(np.concatenate([share, [-wide, wide]]))
        level, column = (z[:-1] + z[1:]) / 2, (columns[:-1] + columns[1:]) / 2
        row = np.searchsorted(half[:, 1], level) - 1
        materials = rows[row][:, np.searchsorted(share, column) - 1]
        seen = (level > levels[0]) & (level < levels[1])
        materials[np.ix_(seen, np.abs(column) < wide)] = self.shape.rear_pane
        sections = np.stack([np.interp(z, half[:, 1], half[:, 0]), z], axis=1)
        return sections, columns, materials

    def roof(self, x: float) -> float:
        """Height in metres of the middle line at relative ``x``."""
        return float(self._top(x)) * self.frame.height

    def floor(self, x: float) -> float:
        """Height in metres of the lower edge at relative ``x``: bumpers are higher than sills."""
        rise = _TAIL_RISE_M if x < 0 else _NOSE_RISE_M
        past = min(max((abs(x) - 0.78) / 0.22, 0.0), 1.0)
        return self.shape.clearance * self.frame.height + rise * past * past

    def belt(self, x: float) -> float:
        """Height in metres of the line under the side windows at relative ``x``."""
        return float(self._belt(x)) * self.frame.height

    def beside(self, x: float) -> float:
        """Half width in metres at the belt's height at relative ``x``."""
        return float(self._width(x)) * self.frame.half_width

    def across(self, x: float, z: Array) -> Array:
        """Half width in metres of the skin at relative ``x`` and heights ``z`` (m)."""
        half = self.section(x)[self.SILL :]
        width: Array = np.interp(z, half[:, 1], half[:, 0])
        return width

    def inside(self, points: Array, margin: float) -> Array:
        """Points ``(N, 3)``, those moved that are not ``margin`` metres within the skin."""
        f = self.frame
        x, y, z = points.T
        along = f.half_length - 0.025
        relative = (x - f.center_x) / along
        for _ in range(3):
            relative = relative + (x - self.place(relative, y, z)[:, 0]) / along
        relative = np.round(np.clip(relative, -0.96, 0.96), 2)
        kept = points.copy()
        for station in np.unique(relative):
            here = relative == station
            kept[here, 2] = np.minimum(z[here], self.roof(float(station)) - margin)
            wide = np.maximum(self.across(float(station), kept[here, 2] + margin) - margin, 0.0)
            # Between the wheel housings, wherever they are: edges run past them.
            low = kept[here, 2] < f.wheel_radius + self._arch_radius + margin
            inner = float(self.section(float(station))[self.ARCH, 0]) - margin
            wide[low] = np.minimum(wide[low], inner)
            kept[here, 1] = np.clip(y[here], -wide, wide)
        return kept

    def on_face(self, end: float, y: Array, z: Array, raised: float) -> Array:
        """Points (metric ``y``, ``z``) on the front (``end`` 1) or rear (-1) face."""
        points = self.place(np.full_like(y, end), y, z)
        points[..., 0] += end * raised
        return points

    def panel(
        self,
        builder: ShapeBuilder,
        end: float,
        outline: Outline,
        material: int,
        *,
        raised: float = 0.008,
        rows: int = 2,
    ) -> None:
        """Add a plate on a face that may go round the corner.

        Args:
            builder: receives it.
            end: which face, 1 front and -1 rear.
            outline: its columns.
            material: of the plate.
            raised: metres before the skin.
            rows: quads from its lower to its upper edge.
        """
        f = self.frame
        outline = _refined(outline)
        tallest = max(high - low for _, low, high in outline)
        rows = max(rows, int(np.ceil(tallest / _ROW)))
        points = np.empty((rows + 1, len(outline), 3))
        for column, (share, low, high) in enumerate(outline):
            z = np.linspace(low, high, rows + 1) * f.height
            beyond = max(abs(share) - 1.0, 0.0)
            x = end * (1.0 - beyond * f.half_width / f.half_length)
            wide = self.across(x, z if beyond else np.full_like(z, z.mean()))
            side = np.clip((abs(share) - 0.85) / 0.15, 0.0, 1.0) * np.sign(share)
            y = np.clip(share, -1.0, 1.0) * wide
            points[:, column] = self.place(np.full_like(y, x), y, z)
            points[:, column, 1] += side * min(raised, _MOST_ASIDE_M)
        points[..., 0] += end * raised
        builder.grid(points, material)

    def disc(
        self,
        builder: ShapeBuilder,
        end: float,
        place: tuple[float, float],
        radius: float,
        material: int,
        *,
        raised: float,
        sides: int = 12,
    ) -> None:
        """Add a round plate (metres) at a share of the half width and of the height of a face."""
        z = place[1] * self.frame.height
        y = place[0] * float(self.across(end, np.array(z)))
        angle = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
        ring = self.on_face(end, y + radius * np.cos(angle), z + radius * np.sin(angle), raised)
        middle = self.on_face(end, np.array([y]), np.array([z]), raised)
        k = np.arange(sides)
        fan = np.stack([np.full(sides, sides), k, (k + 1) % sides], axis=1)
        builder.add(np.concatenate([ring, middle]), fan, material)

    def on_screen(self, y: Array, z: Array, raised: float) -> Array:
        """Points (metric ``y``, ``z``) on the windscreen."""
        high, low = self.shape.windscreen
        x = np.linspace(low, high, 16)
        relative = np.interp(z, self._top(x) * self.frame.height, x)
        points = self.place(relative, y, z)
        points[..., 0] += raised
        return points

    def skin(self, x: Array, column: Array) -> Array:
        """Points of the right side's skin at relative ``x`` and (fractional) section columns."""
        points = np.empty((len(x), 2))
        for k, (station, place) in enumerate(zip(x, column, strict=True)):
            half = self.section(float(station))
            number = np.arange(len(half))
            points[k] = [np.interp(place, number, half[:, axis]) for axis in range(2)]
        return self.place(x, points[:, 0], points[:, 1])

    def _outward(self, x: Array, column: Array) -> Array:
        """Directions that the skin looks to at relative ``x`` and section columns."""
        ahead = self.skin(np.minimum(x + _ASIDE, 1.0), column)
        behind = self.skin(np.maximum(x - _ASIDE, -1.0), column)
        above = self.skin(x, np.minimum(column + 10 * _ASIDE, self.MIDDLE))
        below = self.skin(x, np.maximum(column - 10 * _ASIDE, 0.0))
        return np.cross(above - below, ahead - behind)

    def ribbon(
        self,
        builder: ShapeBuilder,
        path: Sequence[tuple[float, float]],
        material: int,
        *,
        wide: float = 0.009,
        raised: float = 0.003,
        sides: Sequence[float] = (-1.0, 1.0),
    ) -> None:
        """Add a line on the skin, on both sides of the vehicle unless told otherwise.

        Args:
            builder: receives it.
            path: relative x and section column of its points.
            material: of the line.
            wide: metres.
            raised: metres before the skin.
            sides: signs of y.
        """
        x, column = np.array(path).T
        line = self.skin(x, column)
        along = np.gradient(line, axis=0)
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
        outward = self._outward(x, column)
        outward -= (outward * along).sum(axis=1, keepdims=True) * along
        outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
        aside = np.cross(along, outward) * wide / 2
        edges = np.stack([line - aside, line + aside]) + outward * raised
        for sign in sides:
            builder.grid(edges * np.array([1.0, sign, 1.0]), material)

    def side_band(
        self,
        builder: ShapeBuilder,
        x: tuple[float, float],
        z: tuple[float, float],
        material: int,
        *,
        raised: float = 0.005,
        sides: Sequence[float] = (-1.0, 1.0),
        rows: int = 2,
    ) -> None:
        """Add a level strip (relative ``x``, metric ``z``) along the sides."""
        stations = np.linspace(*x, max(2, int(np.ceil((x[1] - x[0]) / 0.12)) + 1))
        height = np.linspace(*z, rows + 1)
        wide = np.stack([self.across(float(station), height) for station in stations]) + raised
        for sign in sides:
            along = np.repeat(stations[:, None], len(height), axis=1)
            up = np.broadcast_to(height, along.shape)
            builder.grid(self.place(along, sign * wide, up), material)
