"""Colours of packets of rays: :mod:`carstage_sim.render.shading` for rays side by side.

Rays to the sun are traced together, and what has no branches runs eight rays at a time: loops over
rows of numbers, one place for each ray. All operations are those of single rays, in their order.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, inlined
from carstage_sim.render.cast import NOTHING
from carstage_sim.render.incoming_light import (
    OVERHANG_M,
    RAY_NEAR_M,
    SHADOW_M,
    openness,
    overhang_share,
    overhang_way,
    radiance_at,
    sky_place,
    sun_may_reach,
    sun_start,
)
from carstage_sim.render.packet_simd import PACKET
from carstage_sim.render.packets import (
    TOGETHER,
    PacketScratch,
    new_packet_scratch,
    packet_scratch_of,
)
from carstage_sim.render.shading import (
    SKY_M,
    any_lamp_on,
    exposed,
    feels_sky,
    footprint,
    is_covered_ground,
    lifted,
    mirrored,
    over_town,
    place_met,
    sky_met,
    through_fog,
    through_rain,
    towards,
    unit_of,
    unmirrored,
    with_mirrored,
)
from carstage_sim.render.shafts import trace_along
from carstage_sim.render.surface import is_leaf, normals_at, turned_normals
from carstage_sim.render.vector_code import LANES, fetch_ahead, put_real, real_at

_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
_PACKETS = TOGETHER // PACKET
"""Packets that are shaded together: rays to the sun from neighbours run side by side."""
_ROW = TOGETHER
"""Rows of numbers lie one behind the other in one array, a known way apart: the compiler then sees
that what a loop writes to one is not what it reads from another."""
_WAY, _DISTANCE, _NORMAL, _SIDE = 3 * _ROW, 6 * _ROW, 7 * _ROW, 10 * _ROW
_PLACE, _PIXEL, _SUNWARDS, _END = 13 * _ROW, 16 * _ROW, 17 * _ROW, 19 * _ROW
_SOLID, _RISE = 18 * _ROW, _WAY + 2 * _ROW
"""Where rows of ``ShadeScratch.seen`` begin, after the three of the colour."""

_AHEAD = 16
"""Rays that the processor is told of before it comes to them."""
_ROUGH, _LIT, _GLOW = _ROW, 2 * _ROW, 3 * _ROW
"""Where rows of ``ShadeScratch.gloss`` begin, after that of the reflectance."""


class ShadeScratch(NamedTuple):
    """Working memory of one thread for packets of rays.

    Attributes:
        packet: of the rays that are traced.
        free: ``(256,)`` float32 share of the sky's light that comes to what each ray met.
        sunlit, covered: ``(256,)`` bool: whether the sun reaches it, whether something may stand
            right above it.
        which: ``(256,)`` int32 rays for which others are traced.
        seen: ``(19 * 256,)`` float32 of each ray and what it met: radiance (red, green, blue), unit
            direction, distance, shading normal, triangle's normal, place, a pixel's side there,
            the direction's cosine with the sun; 0 if it is leaves and else 1.
        gloss: ``(6 * 256,)`` float32 of those that mirror the sky: reflectance, roughness, whether
            the sun shines there, emission.
        sky: ``(5, 256)`` float32 unit directions (x, y, z) in which the sky is seen or mirrored,
            and their places in its table.
    """

    packet: PacketScratch
    free: NDArray[np.float32]
    sunlit: NDArray[np.bool_]
    covered: NDArray[np.bool_]
    which: NDArray[np.int32]
    seen: NDArray[np.float32]
    gloss: NDArray[np.float32]
    sky: NDArray[np.float32]


def new_shade_scratch() -> ShadeScratch:
    """Working memory for one thread."""
    return ShadeScratch(
        new_packet_scratch(),
        np.empty(TOGETHER, np.float32),
        np.empty(TOGETHER, np.bool_),
        np.empty(TOGETHER, np.bool_),
        np.empty(TOGETHER, np.int32),
        np.empty(_END, np.float32),
        np.empty(_GLOW + 3 * _ROW, np.float32),
        np.empty((5, TOGETHER), np.float32),
    )


@device
def shade_scratch_of(memory, worker):  # type: ignore[no-untyped-def]
    """That of one thread, of :func:`carstage_sim.render.crew.for_workers`."""
    return ShadeScratch(
        packet_scratch_of(memory.packet, worker), memory.free[worker], memory.sunlit[worker],
        memory.covered[worker], memory.which[worker], memory.seen[worker], memory.gloss[worker],
        memory.sky[worker],
    )  # fmt: skip


@device
def _want(packet, which, i, start, distance):  # type: ignore[no-untyped-def]
    """Put down that a ray from a place is wanted for ray ``i``."""
    k = packet.wanted[0]
    packet.from_[0, k], packet.from_[1, k], packet.from_[2, k] = start[0], start[1], start[2]
    packet.from_[3, k] = distance
    which[k] = i
    packet.wanted[0] = k + 1


@inlined
def _three(seen, first, k):  # type: ignore[no-untyped-def]
    """Three numbers of ray ``k``: a colour, direction or place."""
    return (
        real_at(seen, first + k),
        real_at(seen, first + _ROW + k),
        real_at(seen, first + 2 * _ROW + k),
    )


@inlined
def _put(seen, first, k, three):  # type: ignore[no-untyped-def]
    """Write what :func:`_three` reads."""
    put_real(seen, first + k, three[0])
    put_real(seen, first + _ROW + k, three[1])
    put_real(seen, first + 2 * _ROW + k, three[2])


@device
def _fetch_normals(frame, rays, i):  # type: ignore[no-untyped-def]
    """Let the processor fetch the normals of what ray ``i`` met."""
    row, number = rays.row[i], max(rays.triangle[i], 0)
    surfaces = frame.static if row < 0 else frame.actors
    fetch_ahead(surfaces.normals, 9 * number)
    fetch_ahead(surfaces.normals, 9 * number + 8)
    fetch_ahead(surfaces.flat, 3 * number)
    fetch_ahead(surfaces.material, number)


@device
def _fetch_rays(rays, order, begin, end):  # type: ignore[no-untyped-def]
    """Let the processor fetch the rays that come next, of which eight lie in a row."""
    for place in range(begin, end, LANES):
        i = order[place]
        fetch_ahead(rays.directions, 3 * i)
        fetch_ahead(rays.directions, 3 * i + 3 * LANES - 1)
        fetch_ahead(rays.t, i)
        fetch_ahead(rays.row, i)
        fetch_ahead(rays.triangle, i)
        fetch_ahead(rays.weights, 2 * i)


@device
def _look(frame, rays, memory, order, begin, count):  # type: ignore[no-untyped-def]
    """Normals of what the rays met, as they are in the scene; directions as they are."""
    seen = memory.seen
    for k in range(min(_AHEAD, count)):
        _fetch_normals(frame, rays, order[begin + k])
    for k in range(count):
        if k + _AHEAD < count:
            _fetch_normals(frame, rays, order[begin + k + _AHEAD])
        i = order[begin + k]
        row, number = rays.row[i], rays.triangle[i]
        d = rays.directions
        _put(seen, _WAY, k, (d[i, 0], d[i, 1], d[i, 2]))
        put_real(seen, _DISTANCE + k, rays.t[i])
        put_real(seen, _SOLID + k, _ONE)
        if row == NOTHING:
            continue
        surfaces = frame.static if row < 0 else frame.actors
        if is_leaf(frame.materials.detail[surfaces.material[number]]):
            put_real(seen, _SOLID + k, _ZERO)
        normals = normals_at(
            frame.scene, surfaces, row, number, rays.weights[i, 0], rays.weights[i, 1]
        )
        _put(seen, _NORMAL, k, (normals[0], normals[1], normals[2]))
        _put(seen, _SIDE, k, (normals[3], normals[4], normals[5]))


@device
def _turn(seen, o, s, pixel_angle, count):  # type: ignore[no-untyped-def]
    """Unit directions, normals towards the origin, places and footprints.

    ``o``: the rays' origin. ``s``: unit direction of the sun.
    """
    for k in range(count):
        x, y, z = _three(seen, _WAY, k)
        dx, dy, dz, length = unit_of(x, y, z)
        d, distance = (dx, dy, dz), real_at(seen, _DISTANCE + k) * length
        n, g, solid = _three(seen, _NORMAL, k), _three(seen, _SIDE, k), real_at(seen, _SOLID + k)
        nx, ny, nz, gx, gy, gz = turned_normals(n, g, solid, d)
        _put(seen, _WAY, k, d)
        put_real(seen, _DISTANCE + k, distance)
        put_real(seen, _SUNWARDS + k, towards(s, d))
        _put(seen, _NORMAL, k, (nx, ny, nz))
        _put(seen, _SIDE, k, (gx, gy, gz))
        _put(seen, _PLACE, k, place_met(o, d, distance))
        put_real(seen, _PIXEL + k, footprint(pixel_angle, d, (gx, gy, gz), distance))


@device
def _find_light(frame, rays, memory, order, begin, count, epic):  # type: ignore[no-untyped-def]
    """What comes of sun and sky to the places that packets met, into ``memory``."""
    light, packet, which, seen = frame.light, memory.packet, memory.which, memory.seen
    packet.wanted[0] = 0
    for k in range(count):
        row = rays.row[order[begin + k]]
        memory.sunlit[k] = False
        memory.covered[k] = False
        if row == NOTHING:
            continue
        leaves, distance = real_at(seen, _SOLID + k) == 0, real_at(seen, _DISTANCE + k)
        n, way, p = _three(seen, _NORMAL, k), _three(seen, _SIDE, k), _three(seen, _PLACE, k)
        memory.free[k] = _ONE
        o = lifted(p, way, distance)
        if epic and feels_sky(leaves, distance):
            memory.free[k] = openness(
                frame.scene, packet.single, o, way[0], way[1], way[2], rays.skip
            )
        else:
            memory.covered[k] = is_covered_ground(row, way, distance)
        if sun_may_reach(light, n, way, leaves):
            _want(packet, which, k, sun_start(light, p, o, leaves), distance)
    s = light.sun_direction
    trace_along(frame.scene, packet, (s[0], s[1], s[2]), RAY_NEAR_M, SHADOW_M, rays.skip, True)
    for k in range(packet.wanted[0]):
        memory.sunlit[which[k]] = packet.met[k] < _ZERO
    packet.wanted[0] = 0
    for k in range(count):
        if memory.covered[k]:
            distance = real_at(seen, _DISTANCE + k)
            start = lifted(_three(seen, _PLACE, k), _three(seen, _SIDE, k), distance)
            _want(packet, which, k, start, distance)
    trace_along(frame.scene, packet, overhang_way(), RAY_NEAR_M, OVERHANG_M, rays.skip, False)
    for k in range(packet.wanted[0]):
        if packet.met[k] >= _ZERO:
            memory.free[which[k]] = overhang_share(packet.met[k])


@device
def _find_in_sky(light, sky, count):  # type: ignore[no-untyped-def]
    """Places of directions in the sky's table."""
    for j in range(count):
        sky[3, j], sky[4, j] = sky_place(light, sky[0, j], sky[1, j], sky[2, j])


@device
def _see_sky(light, rays, memory, order, begin, count):  # type: ignore[no-untyped-def]
    """What the rays see that met nothing."""
    sky, seen, which = memory.sky, memory.seen, memory.which
    met = 0
    for k in range(count):
        if rays.row[order[begin + k]] == NOTHING:
            for axis in range(3):
                sky[axis, met] = real_at(seen, _WAY + axis * _ROW + k)
            which[met] = k
            met += 1
    _find_in_sky(light, sky, met)
    for j in range(met):
        k, d = which[j], (sky[0, j], sky[1, j], sky[2, j])
        colour = radiance_at(light, sky[3, j], sky[4, j])
        _put(seen, 0, k, sky_met(light, d, rays.pixel_angle, colour))
        put_real(seen, _DISTANCE + k, SKY_M)


@device
def _colour(frame, rays, memory, order, begin, count, epic, lamps_on):  # type: ignore[no-untyped-def]
    """Radiance of what the rays met."""
    seen, gloss, sky, single = memory.seen, memory.gloss, memory.sky, memory.packet.single
    light, which, mirrors = frame.light, memory.which, 0
    s = light.sun_direction
    for k in range(count):
        i = order[begin + k]
        if rays.row[i] == NOTHING:
            continue
        nx, ny, nz = _three(seen, _NORMAL, k)
        gx, gy, gz = _three(seen, _SIDE, k)
        d, distance, p = (
            _three(seen, _WAY, k),
            real_at(seen, _DISTANCE + k),
            _three(seen, _PLACE, k),
        )
        r, g, b, lr, lg, lb, fresnel, rough, rx, ry, rz, lit, town = unmirrored(
            frame, rays, single, epic, lamps_on, i, d, distance, p, real_at(seen, _PIXEL + k),
            (nx, ny, nz, gx, gy, gz, real_at(seen, _SOLID + k) == 0),
            (memory.free[k], memory.sunlit[k]),
        )  # fmt: skip
        if fresnel >= 0 and not town:
            sky[0, mirrors], sky[1, mirrors], sky[2, mirrors] = rx, ry, rz
            put_real(gloss, mirrors, fresnel)
            put_real(gloss, _ROUGH + mirrors, rough)
            put_real(gloss, _LIT + mirrors, _ONE if lit else _ZERO)
            _put(gloss, _GLOW, mirrors, (lr, lg, lb))
            which[mirrors] = k
            mirrors += 1
        elif fresnel >= 0:
            way, o = (rx, ry, rz), lifted(p, (gx, gy, gz), distance)
            shown = mirrored(frame, single, rays.skip, o, way, lamps_on)
            shine = (fresnel, rough, towards(s, way))
            r, g, b = with_mirrored(light, (r, g, b), shown, shine, lit)
            r, g, b = r + lr, g + lg, b + lb
        else:
            r, g, b = r + lr, g + lg, b + lb
        _put(seen, 0, k, (r, g, b))
    _find_in_sky(light, sky, mirrors)
    for j in range(mirrors):
        k, way = which[j], (sky[0, j], sky[1, j], sky[2, j])
        shown = over_town(light, way[2], radiance_at(light, sky[3, j], sky[4, j]))
        shine = (real_at(gloss, j), real_at(gloss, _ROUGH + j), towards(s, way))
        lit = real_at(gloss, _LIT + j) > 0
        r, g, b = with_mirrored(light, _three(seen, 0, k), shown, shine, lit)
        lr, lg, lb = _three(gloss, _GLOW, j)
        _put(seen, 0, k, (r + lr, g + lg, b + lb))


@device
def _expose_packet(light, rays, memory, order, begin, count, out):  # type: ignore[no-untyped-def]
    """Display light of what a packet met."""
    seen, height = memory.seen, rays.origin[2]
    for k in range(count):
        rise, sunwards = real_at(seen, _RISE + k), real_at(seen, _SUNWARDS + k)
        colour = through_fog(
            light, height, rise, sunwards, real_at(seen, _DISTANCE + k), _three(seen, 0, k)
        )
        _put(seen, 0, k, colour)
    if light.rain > 0:
        for k in range(count):
            colour = through_rain(
                light, rays, _three(seen, _WAY, k), real_at(seen, _DISTANCE + k), _three(seen, 0, k)
            )
            _put(seen, 0, k, colour)
    for k in range(count):
        _put(seen, 0, k, exposed(light, _three(seen, 0, k)))
    for k in range(count):
        for channel in range(3):
            out[order[begin + k], channel] = real_at(seen, channel * _ROW + k)


@device
def shade_packets(frame, rays, memory, epic, order, starts, first, last, out):  # type: ignore[no-untyped-def]
    """Colours of hits of rays that run side by side: linear display light, 0-1.

    Args:
        frame: a :class:`carstage_sim.render.shading.ShadedFrame`.
        rays: a :class:`carstage_sim.render.shading.RayHits`.
        memory: a :class:`ShadeScratch` of this thread.
        epic: whether the picture is worth more rays.
        order, starts: packets, see :func:`carstage_sim.render.packets.cast_packets`.
        first, last: half-open range of packets.
        out: ``(N, 3)`` float32, to be filled.
    """
    light, seen = frame.light, memory.seen
    lamps_on = any_lamp_on(frame)
    o = (rays.origin[0], rays.origin[1], rays.origin[2])
    s = (light.sun_direction[0], light.sun_direction[1], light.sun_direction[2])
    for number in range(first, last, _PACKETS):
        begin = starts[number]
        count = starts[min(number + _PACKETS, last)] - begin
        _look(frame, rays, memory, order, begin, count)
        _fetch_rays(rays, order, begin + count, starts[min(number + 2 * _PACKETS, last)])
        _turn(seen, o, s, rays.pixel_angle, count)
        _find_light(frame, rays, memory, order, begin, count, epic)
        _see_sky(light, rays, memory, order, begin, count)
        _colour(frame, rays, memory, order, begin, count, epic, lamps_on)
        _expose_packet(light, rays, memory, order, begin, count, out)
