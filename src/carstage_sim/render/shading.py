"""From hits to colours: sun with traced shadows, sky, reflections, lamps, fog, film curve.

Two qualities share the code. Low traces one shadow ray, one short ray that finds what stands right
above the ground, and mirrors the town in water only; epic feels the sky with three rays and mirrors
the town in all that is glossy.

Vectors and colours are tuples of three numbers in single precision: places in world metres, unit
directions, linear radiance. The graphics card's shaders are translated from this source.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, inlined, kernel
from carstage_sim.mesh import Material
from carstage_sim.render.arithmetic import exp_down, power_of_slant
from carstage_sim.render.cast import NOTHING, Scene, trace
from carstage_sim.render.detail import GLAZING, hash_unit, noise
from carstage_sim.render.incoming_light import (
    OVER_PI,
    OVERHANG_M,
    RAY_NEAR_M,
    SHADOW_M,
    openness,
    overhang_share,
    overhang_way,
    radiance_at,
    sees_sun,
    sky_irradiance,
    sky_place,
    sky_radiance,
    sun_is_up,
    sun_may_reach,
    sun_start,
    under_overhang,
)
from carstage_sim.render.lamps import Lamps, glow, lamp_light
from carstage_sim.render.materials import Glow, MaterialTable, Paint
from carstage_sim.render.object_appearance import ObjectAppearance
from carstage_sim.render.packet_simd import PACKET
from carstage_sim.render.packets import TOGETHER, PacketScratch, new_packet_scratch
from carstage_sim.render.scene import Surfaces
from carstage_sim.render.shafts import trace_along
from carstage_sim.render.sky import Lighting
from carstage_sim.render.stars import starlight
from carstage_sim.render.surface import facing_normals, is_leaf, surface_material, water
from carstage_sim.render.weathering import fog_share, rain_share

_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
_HALF: Any = np.float32(0.5)
_STREET_LAMP = int(Glow.STREET_LAMP)
_BODY = int(Paint.BODY)
_FIRST_PAINT, _LAST_PAINT = int(Material.PAINT_WHITE), int(Material.PAINT_RED)
_SUN_DISC_COS: Any = np.float32(0.99996)
"""Cosine of the sun disc's angular radius, half a degree: twice the real one."""
_SUN_DISC_GAIN: Any = np.float32(40)
"""Radiance of the disc for each unit of the sun's irradiance."""
_SKY_M: Any = np.float32(2500.0)
"""Length of air between the camera and the sky, for fog and rain."""
_LEAST_FACING: Any = np.float32(0.06)
"""Least cosine at which a pixel's footprint on a surface is measured."""
_MIRROR_NEAR_M: Any = np.float32(1e-3)
_MIRROR_M: Any = np.float32(150.0)
"""What is farther is not mirrored, but the sky."""
_MIRROR_SUN: Any = np.float32(0.6)
"""Share of the sun's light on what is mirrored, where no shadow is traced."""
_CLEAR_GLOSS: Any = np.float32(0.07)
"""Reflectance at normal incidence above which a mirrored surface mirrors in turn."""
_MIRROR_FOOTPRINT_M: Any = np.float32(0.1)
_MIRROR_FOOTPRINT_PER_M: Any = np.float32(0.01)
"""Footprint on what is mirrored, and its growth with the distance."""
_LEAST_FRESNEL: Any = np.float32(0.02)
"""Below it the town is not mirrored."""
_MIRRORING_M: Any = np.float32(120.0)
"""Surfaces farther from the camera mirror the sky only."""
_MIRRORING_WATER: Any = np.float32(0.1)
"""Share of standing water from which ground mirrors the town."""
_MIRRORING_ROUGHNESS: Any = np.float32(0.35)
"""Roughness below which surfaces mirror the town, quality epic."""
_MATT_ROUGHNESS: Any = np.float32(0.75)
"""Roughness from which nothing is mirrored."""
_THROUGH_WITHIN_M: Any = np.float32(40.0)
"""Distance from the camera from which nobody sees what is behind glass."""
_CABIN_M: Any = np.float32(14.0)
"""Length of the longest room behind a pane."""
_INDOOR_SKY: Any = np.float32(0.42)
_INDOOR_SUN: Any = np.float32(0.16)
"""Shares of the light that come to the inside of a car."""
_PANE: Any = np.float32(0.68)
"""Share of the light that a pane lets through."""
_BEYOND_PANE_M: Any = np.float32(5e-3)
_TRIM: Any = np.float32(0.045)
"""Colour of the lining behind painted sheet metal."""
_TOWN_HORIZON: Any = np.float32(0.12)
"""Sine of the elevation below which mirrored sky fades into the town."""
_OPENNESS_WITHIN_M: Any = np.float32(60.0)
_OVERHANG_WITHIN_M: Any = np.float32(90.0)
"""Distances from the camera within which the sky's cover is traced, epic and low."""
_LEVEL_GROUND: Any = np.float32(0.7)
"""Upward part of a normal from which a surface is ground under an overhang."""
_WET_GROUND: Any = np.float32(0.5)
"""Upward part of a normal above which a surface holds water."""
_RIPPLES_PER_M: Any = np.float32(23)
_WATER_ROUGHNESS: Any = np.float32(0.06)
_LIFT_M: Any = np.float32(2e-3)
_LIFT_PER_M: Any = np.float32(2e-4)
"""How far above a surface rays from it begin, and its growth with the distance."""
_LAMP_RADIANCE: Any = np.float32(6.0)
"""Radiance of a street lamp of full power."""
_ROOM_RADIANCE: Any = np.float32(1.1)
"""Radiance of a lit room behind a window."""
_CLIENT_GLOW: Any = np.float32(3)
"""Radiance of what clients let glow, for each unit of its colour."""
_GLINT: Any = np.float32(0.02)
_SHARPEST_GLINT: Any = np.float32(2000.0)
"""Strength of the sun's reflection, and its greatest exponent."""


_PACKETS = TOGETHER // PACKET
"""Packets that are shaded together: rays to the sun from neighbours run side by side."""
_DISTANCE, _RISE, _SUNWARDS = 3, 4, 5
"""Rows of ``ShadeScratch.seen`` after the three of the colour."""


class ShadedFrame(NamedTuple):
    """What kernels need of a frame to colour its hits.

    Attributes:
        scene: what rays meet.
        static, actors: surfaces of the two geometries.
        appearance: what clients changed about the town's objects.
        colour: ``(I, P, 3)`` float32 linear colours of each instance row's paints.
        light_state: ``(I,)`` uint32 light bits of each row.
        materials: of all triangles.
        light: sun, sky and weather.
        lamps: street lamps and headlights.
    """

    scene: Scene
    static: Surfaces
    actors: Surfaces
    appearance: ObjectAppearance
    colour: NDArray[np.float32]
    light_state: NDArray[np.uint32]
    materials: MaterialTable
    light: Lighting
    lamps: Lamps


class RayHits(NamedTuple):
    """Rays of a camera and what they met; see :func:`carstage_sim.render.cast.cast_rays`.

    Attributes:
        origin: ``(3,)`` float32 world metres.
        directions: ``(N, 3)`` float32, any length.
        t, row, triangle, weights: the hits.
        skip: instance row that no ray meets, negative for none.
        pixel_angle: radians between the rays of neighbouring pixels.
    """

    origin: NDArray[np.float32]
    directions: NDArray[np.float32]
    t: NDArray[np.float32]
    row: NDArray[np.int32]
    triangle: NDArray[np.int32]
    weights: NDArray[np.float32]
    skip: int
    pixel_angle: np.float32


@device
def _film(value):  # type: ignore[no-untyped-def]
    """Exposed light as display light, 0-1: linear in the dark, saturating like film."""
    return _ONE - exp_down(max(value, _ZERO))


@inlined
def _emission(frame, m, hit_actor, owner, emitted):  # type: ignore[no-untyped-def]
    """Radiance that a surface emits: lamps by their state, lit rooms, what clients let glow."""
    light, appearance, lamps = frame.light, frame.appearance, frame.lamps
    kind = frame.materials.glow[m]
    bits = frame.light_state[hit_actor] if hit_actor >= 0 else 0
    strength, r, g, b = glow(kind, bits, light.time_s)
    if hit_actor < 0:
        lamp = appearance.lamp[owner]
        if lamp >= 0 and kind == _STREET_LAMP:
            strength = _LAMP_RADIANCE
            r, g, b = lamps.power[lamp, 0], lamps.power[lamp, 1], lamps.power[lamp, 2]
    if emitted > 0:
        strength, r, g, b = emitted * _ROOM_RADIANCE, _ONE, np.float32(0.74), np.float32(0.42)
    strength *= light.lamp
    r, g, b = r * strength, g * strength, b * strength
    if hit_actor < 0:
        more = _CLIENT_GLOW * light.lamp
        r += appearance.glow[owner, 0] * more
        g += appearance.glow[owner, 1] * more
        b += appearance.glow[owner, 2] * more
    return r, g, b


@device
def _mirrored(frame, scratch, skip, o, d, lamps_on):  # type: ignore[no-untyped-def]
    """Radiance that comes from a unit direction: the sky, or the town without cast shadows."""
    light, materials = frame.light, frame.materials
    dx, dy, dz = d
    hit = trace(frame.scene, scratch, o, d, _MIRROR_NEAR_M, _MIRROR_M, skip, False)
    distance, hit_actor, number, u, v = hit[0], hit[1], hit[2], hit[3], hit[4]
    if hit_actor == NOTHING:
        return sky_radiance(light, dx, dy, dz)
    surfaces = frame.static if hit_actor < 0 else frame.actors
    m = surfaces.material[number]
    owner = int(surfaces.object_id[number])
    leaves = is_leaf(materials.detail[m])
    nx, ny, nz, _, _, _ = facing_normals(
        frame.scene, surfaces, hit_actor, number, u, v, leaves, dx, dy, dz
    )
    px, py, pz = o[0] + dx * distance, o[1] + dy * distance, o[2] + dz * distance
    _, cr, cg, cb, _, f0, emitted = surface_material(
        frame, surfaces, (hit_actor, number, u, v), (px, py, pz), (nx, ny, nz),
        _MIRROR_FOOTPRINT_M + distance * _MIRROR_FOOTPRINT_PER_M,
    )  # fmt: skip
    er, eg, eb = sky_irradiance(light, nx, ny, nz)
    s = light.sun_direction
    sunny = max(nx * s[0] + ny * s[1] + nz * s[2], _ZERO) * _MIRROR_SUN
    er, eg, eb = er + light.sun[0] * sunny, eg + light.sun[1] * sunny, eb + light.sun[2] * sunny
    if lamps_on:
        lr, lg, lb = lamp_light(frame.lamps, light.night, px, py, pz, nx, ny, nz)
        er, eg, eb = er + lr, eg + lg, eb + lb
    r, g, b = cr * er * OVER_PI, cg * eg * OVER_PI, cb * eb * OVER_PI
    if f0 > _CLEAR_GLOSS:
        # Glass and metal mirror in turn: about the sky at the side.
        a = light.ambient
        r += (a[1, 0] * OVER_PI - r) * f0
        g += (a[1, 1] * OVER_PI - g) * f0
        b += (a[1, 2] * OVER_PI - b) * f0
    lr, lg, lb = _emission(frame, m, hit_actor, owner, emitted)
    r, g, b = r + lr, g + lg, b + lb
    fog = fog_share(light, o[2], dz, distance)
    return (
        r + (light.fog[0] - r) * fog,
        g + (light.fog[1] - g) * fog,
        b + (light.fog[2] - b) * fog,
    )


@device
def _seen_through(frame, scratch, skip, o, d, owner, lamps_on):  # type: ignore[no-untyped-def]
    """Radiance from behind a pane: its own object's inside in half light, or what is beyond.

    ``owner``: instance row and level object of the pane.
    """
    light, materials = frame.light, frame.materials
    dx, dy, dz = d
    hit = trace(frame.scene, scratch, o, d, _MIRROR_NEAR_M, _CABIN_M, skip, False)
    distance, hit_actor, number, u, v = hit[0], hit[1], hit[2], hit[3], hit[4]
    if hit_actor == NOTHING or hit_actor != owner[0]:
        return _mirrored(frame, scratch, skip, o, d, lamps_on)
    surfaces = frame.static if hit_actor < 0 else frame.actors
    if hit_actor < 0 and int(surfaces.object_id[number]) != owner[1]:
        return _mirrored(frame, scratch, skip, o, d, lamps_on)
    m = surfaces.material[number]
    px, py, pz = o[0] + dx * distance, o[1] + dy * distance, o[2] + dz * distance
    if materials.detail[m] == GLAZING:
        beyond = (px + dx * _BEYOND_PANE_M, py + dy * _BEYOND_PANE_M, pz + dz * _BEYOND_PANE_M)
        r, g, b = _mirrored(frame, scratch, skip, beyond, d, lamps_on)
        return r * _PANE, g * _PANE, b * _PANE
    nx, ny, nz, _, _, _ = facing_normals(
        frame.scene, surfaces, hit_actor, number, u, v, False, dx, dy, dz
    )
    _, cr, cg, cb, _, _, _ = surface_material(
        frame, surfaces, (hit_actor, number, u, v), (px, py, pz), (nx, ny, nz),
        _MIRROR_FOOTPRINT_M,
    )  # fmt: skip
    if materials.paint[m] == _BODY or _FIRST_PAINT <= m <= _LAST_PAINT:
        cr, cg, cb = _TRIM, _TRIM, _TRIM
    er, eg, eb = sky_irradiance(light, nx, ny, nz)
    s = light.sun_direction
    sunny = max(nx * s[0] + ny * s[1] + nz * s[2], _ZERO) * _INDOOR_SUN
    er = er * _INDOOR_SKY + light.sun[0] * sunny
    eg = eg * _INDOOR_SKY + light.sun[1] * sunny
    eb = eb * _INDOOR_SKY + light.sun[2] * sunny
    if lamps_on:
        lr, lg, lb = lamp_light(frame.lamps, light.night, px, py, pz, nx, ny, nz)
        er, eg, eb = er + lr * _INDOOR_SUN, eg + lg * _INDOOR_SUN, eb + lb * _INDOOR_SUN
    return cr * er * OVER_PI, cg * eg * OVER_PI, cb * eb * OVER_PI


@inlined
def _mirrored_sky(light, rx, ry, rz):  # type: ignore[no-untyped-def]
    """Radiance that comes from a unit direction where no ray is traced."""
    r, g, b = sky_radiance(light, rx, ry, rz)
    if rz < _TOWN_HORIZON:
        # Near and below the horizon the town reflects, not the sky.
        a = light.ambient
        ground = min(max((_TOWN_HORIZON - rz) * np.float32(5), _ZERO), _ONE)
        r += (a[2, 0] * OVER_PI - r) * ground
        g += (a[2, 1] * OVER_PI - g) * ground
        b += (a[2, 2] * OVER_PI - b) * ground
    return r, g, b


@device
def _glint(towards_sun, rough, fresnel):  # type: ignore[no-untyped-def]
    """Sun's reflection for each unit of its irradiance, where a mirror ray meets that cosine."""
    if towards_sun <= 0:
        return _ZERO
    square = rough * rough
    power = min(np.float32(2) / max(square * square, np.float32(1e-3)), _SHARPEST_GLINT)
    # (1 - x) ** n is about exp(-n * (x + x^2 / 2 + x^3 / 3 + x^4 / 4)); what is off is dark.
    x = max(_ONE - towards_sun, _ZERO)
    fall = x * (_ONE + x * (_HALF + x * (np.float32(1 / 3) + x * np.float32(1 / 4))))
    return exp_down(power * fall) * (power + np.float32(2)) * _GLINT * fresnel


@inlined
def _water_on(light, pool, rough, p, n, pixel):  # type: ignore[no-untyped-def]
    """Roughness and the normal's x and y of ground under a share ``pool`` of water."""
    # Water is level; drops and the stones under a film let it tremble.
    rough_water = (_ONE - pool) * _WATER_ROUGHNESS + light.rain * np.float32(0.02)
    tremble = rough_water * min(np.float32(0.05) / pixel, _ONE)
    return (
        rough + (_WATER_ROUGHNESS - rough) * min(pool + pool, _ONE),
        n[0] + tremble * noise(p[0] * _RIPPLES_PER_M, p[1] * _RIPPLES_PER_M, 31),
        n[1] + tremble * noise(p[0] * _RIPPLES_PER_M, p[1] * _RIPPLES_PER_M, 32),
    )


@inlined
def _is_covered_ground(row, g, distance):  # type: ignore[no-untyped-def]
    """Whether what may stand right above a surface takes light of the sky from it."""
    return row < 0 and g[2] > _LEVEL_GROUND and distance < _OVERHANG_WITHIN_M


@inlined
def _feels_sky(leaves, distance):  # type: ignore[no-untyped-def]
    """Whether a surface's sky is felt by rays, where the picture is worth them."""
    return not leaves and distance < _OPENNESS_WITHIN_M


@inlined
def _uncovered(frame, scratch, skip, epic, o, g, distance, kinds):  # type: ignore[no-untyped-def]
    """Share of the sky's light that is left; ``kinds``: instance row, whether it is leaves."""
    if epic and _feels_sky(kinds[1], distance):
        return openness(frame.scene, scratch, o, g[0], g[1], g[2], skip)
    if _is_covered_ground(kinds[0], g, distance):
        return under_overhang(frame.scene, scratch, o, skip)
    return _ONE


@inlined
def _unit(directions, i):  # type: ignore[no-untyped-def]
    """Unit direction of ray ``i``, and its length."""
    return _unit_of(directions[i, 0], directions[i, 1], directions[i, 2])


@inlined
def _unit_of(dx, dy, dz):  # type: ignore[no-untyped-def]
    """Unit direction of a vector, and its length."""
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    return dx / length, dy / length, dz / length, length


@inlined
def _lifted(p, g, distance):  # type: ignore[no-untyped-def]
    """Where rays from a surface begin."""
    lift = _LIFT_M + distance * _LIFT_PER_M
    return p[0] + g[0] * lift, p[1] + g[1] * lift, p[2] + g[2] * lift


@inlined
def _place_met(rays, d, distance):  # type: ignore[no-untyped-def]
    """Where a ray of unit direction ``d`` ends."""
    o = rays.origin
    return o[0] + d[0] * distance, o[1] + d[1] * distance, o[2] + d[2] * distance


@inlined
def _normals_met(frame, rays, i, d):  # type: ignore[no-untyped-def]
    """Shading normal and triangle's normal where ray ``i`` ends, and whether it met leaves."""
    row, number = rays.row[i], rays.triangle[i]
    surfaces = frame.static if row < 0 else frame.actors
    leaves = is_leaf(frame.materials.detail[surfaces.material[number]])
    nx, ny, nz, gx, gy, gz = facing_normals(
        frame.scene, surfaces, row, number, rays.weights[i, 0], rays.weights[i, 1], leaves,
        d[0], d[1], d[2],
    )  # fmt: skip
    return nx, ny, nz, gx, gy, gz, leaves


@inlined
def _hit_radiance(frame, rays, scratch, epic, lamps_on, i, d, distance, normals, free, sunlit):  # type: ignore[no-untyped-def]
    """Radiance of what ray ``i`` of unit direction ``d`` met, without the air between.

    ``normals``: see :func:`_normals_met`. ``free``: share of the sky's light. ``sunlit``: whether
    the sun reaches the place, if it is turned to it.
    """
    light = frame.light
    lx, ly, lz = light.sun_direction[0], light.sun_direction[1], light.sun_direction[2]
    dx, dy, dz = d
    px, py, pz = _place_met(rays, d, distance)
    hit_actor, number, u, v = rays.row[i], rays.triangle[i], rays.weights[i, 0], rays.weights[i, 1]
    surfaces = frame.static if hit_actor < 0 else frame.actors
    m = surfaces.material[number]
    nx, ny, nz, gx, gy, gz, leaves = normals
    slant = power_of_slant(min(max(abs(dx * gx + dy * gy + dz * gz), _LEAST_FACING), _ONE))
    pixel = distance * rays.pixel_angle / slant
    kind, cr, cg, cb, rough, f0, emitted = surface_material(
        frame, surfaces, (hit_actor, number, u, v), (px, py, pz), (nx, ny, nz), pixel
    )
    if is_leaf(kind) and light.wind > 0:
        # Wind turns leaves to and from the light.
        beat = math.sin(light.time_s * np.float32(9) + hash_unit(number, 5, 77) * np.float32(40))
        flutter = _ONE + np.float32(0.4) * light.wind * beat
        cr, cg, cb = cr * flutter, cg * flutter, cb * flutter
    pool = _ZERO
    if light.wetness > 0 and nz > _WET_GROUND and hit_actor < 0 and not leaves:
        pool = water(light, kind, px, py, pixel)
        soaked = _ONE - np.float32(0.5) * light.wetness
        cr, cg, cb = cr * soaked, cg * soaked, cb * soaked
        rough, nx, ny = _water_on(light, pool, rough, (px, py), (nx, ny), pixel)
    er, eg, eb = sky_irradiance(light, nx, ny, nz)
    er, eg, eb = er * free, eg * free, eb * free
    sunny = nx * lx + ny * ly + nz * lz
    if leaves:
        # Leaves let light through: the crown's dark side is not black.
        sunny = max(sunny * np.float32(0.7) + np.float32(0.3), np.float32(0.12))
    lit = False
    if sun_is_up(light) and sunny > 0 and (leaves or gx * lx + gy * ly + gz * lz > 0):
        lit = sunlit
        if lit:
            er += light.sun[0] * sunny
            eg += light.sun[1] * sunny
            eb += light.sun[2] * sunny
        elif leaves:
            er += light.sun[0] * sunny * np.float32(0.22)
            eg += light.sun[1] * sunny * np.float32(0.24)
            eb += light.sun[2] * sunny * np.float32(0.12)
    if lamps_on:
        lr, lg, lb = lamp_light(frame.lamps, light.night, px, py, pz, nx, ny, nz)
        er, eg, eb = er + lr, eg + lg, eb + lb
    r, g, b = cr * er * OVER_PI, cg * eg * OVER_PI, cb * eb * OVER_PI
    if kind == GLAZING and distance < _THROUGH_WITHIN_M:
        o = _lifted((px, py, pz), (-gx, -gy, -gz), distance)
        owner = (hit_actor, int(surfaces.object_id[number]))
        tr, tg, tb = _seen_through(frame, scratch, rays.skip, o, d, owner, lamps_on)
        near = _PANE * min((_THROUGH_WITHIN_M - distance) * np.float32(0.1), _ONE)
        r, g, b = r + tr * near, g + tg * near, b + tb * near
    if rough < _MATT_ROUGHNESS:
        smooth = _ONE - rough
        facing = min(abs(dx * nx + dy * ny + dz * nz), _ONE)
        grazing = _ONE - facing
        square = grazing * grazing
        fresnel = f0 + (_ONE - f0) * (square * square * grazing) * smooth * smooth
        back = np.float32(2) * (dx * nx + dy * ny + dz * nz)
        rx, ry, rz = dx - back * nx, dy - back * ny, dz - back * nz
        glossy = pool > _MIRRORING_WATER or (epic and rough < _MIRRORING_ROUGHNESS)
        if glossy and fresnel > _LEAST_FRESNEL and distance < _MIRRORING_M:
            o = _lifted((px, py, pz), (gx, gy, gz), distance)
            sr, sg, sb = _mirrored(frame, scratch, rays.skip, o, (rx, ry, rz), lamps_on)
        else:
            sr, sg, sb = _mirrored_sky(light, rx, ry, rz)
        r, g, b = r + (sr - r) * fresnel, g + (sg - g) * fresnel, b + (sb - b) * fresnel
        if lit:
            glint = _glint(rx * lx + ry * ly + rz * lz, rough, fresnel)
            r += light.sun[0] * glint
            g += light.sun[1] * glint
            b += light.sun[2] * glint
    lr, lg, lb = _emission(frame, m, hit_actor, int(surfaces.object_id[number]), emitted)
    return r + lr, g + lg, b + lb


@inlined
def _towards_sun(light, d):  # type: ignore[no-untyped-def]
    """Cosine between a unit direction and that of the sun."""
    s = light.sun_direction
    return d[0] * s[0] + d[1] * s[1] + d[2] * s[2]


@inlined
def _through_fog(light, height, rise, sunwards, distance, colour):  # type: ignore[no-untyped-def]
    """Radiance that is left of a colour, with the light of the fog on the way.

    ``height``: z of the camera. ``rise``, ``sunwards``: of the ray's unit direction.
    """
    r, g, b = colour
    fog = fog_share(light, height, rise, distance)
    halo = max(sunwards, _ZERO)
    halo = halo * halo
    halo = halo * halo
    halo = halo * halo
    r += (light.fog[0] + light.fog_glow[0] * halo - r) * fog
    g += (light.fog[1] + light.fog_glow[1] * halo - g) * fog
    b += (light.fog[2] + light.fog_glow[2] * halo - b) * fog
    return r, g, b


@inlined
def _through_rain(light, rays, d, distance, colour):  # type: ignore[no-untyped-def]
    """Radiance that is left of a colour, with the light of the rain on the way."""
    r, g, b = colour
    if light.rain > 0:
        veil = rain_share(light, d[0], d[1], d[2], distance, rays.pixel_angle)
        a = light.ambient
        r += ((a[1, 0] * OVER_PI + light.fog[0]) * _HALF - r) * veil
        g += ((a[1, 1] * OVER_PI + light.fog[1]) * _HALF - g) * veil
        b += ((a[1, 2] * OVER_PI + light.fog[2]) * _HALF - b) * veil
    return r, g, b


@inlined
def _lamps_on(frame):  # type: ignore[no-untyped-def]
    """Whether any lamp shines."""
    lamps = frame.lamps
    on = frame.light.night > 0
    for k in range(lamps.power.shape[0]):
        on = on or lamps.power[k, 0] + lamps.power[k, 1] + lamps.power[k, 2] > 0
    return on


@inlined
def _sky_met(light, d, pixel_angle, colour):  # type: ignore[no-untyped-def]
    """Radiance of the sky of a colour, the stars and the sun's disc in a unit direction."""
    r, g, b = colour
    if light.stars > 0:
        star = starlight(d[0], d[1], d[2], pixel_angle)
        r += star[0] * light.stars
        g += star[1] * light.stars
        b += star[2] * light.stars
    s = light.sun_direction
    if sun_is_up(light) and d[0] * s[0] + d[1] * s[1] + d[2] * s[2] > _SUN_DISC_COS:
        r += light.sun[0] * _SUN_DISC_GAIN
        g += light.sun[1] * _SUN_DISC_GAIN
        b += light.sun[2] * _SUN_DISC_GAIN
    return r, g, b


@inlined
def _exposed(light, colour):  # type: ignore[no-untyped-def]
    """Display light of a colour."""
    r, g, b = colour
    return _film(r * light.exposure), _film(g * light.exposure), _film(b * light.exposure)


@kernel
def shade_rays(frame, rays, scratch, epic, first, last, out):  # type: ignore[no-untyped-def]
    """Colours of hits: linear display light, 0-1. The card's shaders are made from this.

    Args:
        frame: a :class:`ShadedFrame`.
        rays: a :class:`RayHits`.
        scratch: working memory of this thread.
        epic: whether the picture is worth more rays.
        first, last: half-open range of rays.
        out: ``(N, 3)`` float32, to be filled.
    """
    light = frame.light
    lamps_on = _lamps_on(frame)
    for i in range(first, last):
        dx, dy, dz, length = _unit(rays.directions, i)
        d = (dx, dy, dz)
        if rays.row[i] == NOTHING:
            distance = _SKY_M
            sky = sky_radiance(light, dx, dy, dz)
            r, g, b = _sky_met(light, d, rays.pixel_angle, sky)
        else:
            distance = rays.t[i] * length
            normals = _normals_met(frame, rays, i, d)
            n, way = (normals[0], normals[1], normals[2]), (normals[3], normals[4], normals[5])
            leaves = normals[6]
            p = _place_met(rays, d, distance)
            o = _lifted(p, way, distance)
            free = _uncovered(
                frame, scratch, rays.skip, epic, o, way, distance, (rays.row[i], leaves)
            )
            sunlit = False
            if sun_may_reach(light, n, way, leaves):
                start = sun_start(light, p, o, leaves)
                sunlit = sees_sun(frame.scene, scratch, light, start, rays.skip)
            r, g, b = _hit_radiance(
                frame, rays, scratch, epic, lamps_on, i, d, distance, normals, free, sunlit
            )
        sunwards = _towards_sun(light, d)
        colour = _through_fog(light, rays.origin[2], d[2], sunwards, distance, (r, g, b))
        r, g, b = _exposed(light, _through_rain(light, rays, d, distance, colour))
        out[i, 0], out[i, 1], out[i, 2] = r, g, b


class ShadeScratch(NamedTuple):
    """Working memory of one thread for packets of rays.

    Attributes:
        packet: of the rays that are traced.
        normals: ``(6, 256)`` float32 see :func:`_normals_met`.
        free: ``(256,)`` float32 share of the sky's light that comes to what each ray met.
        leaves, sunlit, covered: ``(256,)`` bool: whether it is leaves, whether the sun reaches it,
            whether something may stand right above it.
        which: ``(256,)`` int32 rays for which others are traced.
        seen: ``(6, 256)`` float32 radiance (red, green, blue) of what each ray met, how far that
            is, and the ray's rise and cosine with the sun.
        sky: ``(5, 256)`` float32 unit directions (x, y, z) of the rays that met nothing, and their
            places in the sky's table.
    """

    packet: PacketScratch
    normals: NDArray[np.float32]
    free: NDArray[np.float32]
    leaves: NDArray[np.bool_]
    sunlit: NDArray[np.bool_]
    covered: NDArray[np.bool_]
    which: NDArray[np.int32]
    seen: NDArray[np.float32]
    sky: NDArray[np.float32]


def new_shade_scratch() -> ShadeScratch:
    """Working memory for one thread."""
    return ShadeScratch(
        new_packet_scratch(),
        np.empty((6, TOGETHER), np.float32),
        np.empty(TOGETHER, np.float32),
        np.empty(TOGETHER, np.bool_),
        np.empty(TOGETHER, np.bool_),
        np.empty(TOGETHER, np.bool_),
        np.empty(TOGETHER, np.int32),
        np.empty((6, TOGETHER), np.float32),
        np.empty((5, TOGETHER), np.float32),
    )


@device
def _want(packet, which, i, start, distance):  # type: ignore[no-untyped-def]
    """Put down that a ray from a place is wanted for ray ``i``."""
    k = packet.wanted[0]
    packet.from_[0, k], packet.from_[1, k], packet.from_[2, k] = start[0], start[1], start[2]
    packet.from_[3, k] = distance
    which[k] = i
    packet.wanted[0] = k + 1


@device
def _find_light(frame, rays, memory, order, begin, count, epic):  # type: ignore[no-untyped-def]
    """What comes of sun and sky to the places that packets met, into ``memory``."""
    light, packet, which = frame.light, memory.packet, memory.which
    packet.wanted[0] = 0
    for i in range(count):
        ray = order[begin + i]
        memory.sunlit[i] = False
        memory.covered[i] = False
        if rays.row[ray] == NOTHING:
            continue
        dx, dy, dz, length = _unit(rays.directions, ray)
        d = (dx, dy, dz)
        distance = rays.t[ray] * length
        normals = _normals_met(frame, rays, ray, d)
        n, way = (normals[0], normals[1], normals[2]), (normals[3], normals[4], normals[5])
        leaves = normals[6]
        for k in range(3):
            memory.normals[k, i] = n[k]
            memory.normals[3 + k, i] = way[k]
        memory.leaves[i] = leaves
        memory.free[i] = _ONE
        p = _place_met(rays, d, distance)
        o = _lifted(p, way, distance)
        if epic and _feels_sky(leaves, distance):
            memory.free[i] = openness(
                frame.scene, packet.single, o, way[0], way[1], way[2], rays.skip
            )
        else:
            memory.covered[i] = _is_covered_ground(rays.row[ray], way, distance)
        if sun_may_reach(light, n, way, leaves):
            _want(packet, which, i, sun_start(light, p, o, leaves), distance)
    s = light.sun_direction
    trace_along(frame.scene, packet, (s[0], s[1], s[2]), RAY_NEAR_M, SHADOW_M, rays.skip, True)
    for k in range(packet.wanted[0]):
        memory.sunlit[which[k]] = packet.met[k] < _ZERO
    packet.wanted[0] = 0
    for i in range(count):
        if not memory.covered[i]:
            continue
        ray = order[begin + i]
        dx, dy, dz, length = _unit(rays.directions, ray)
        d = (dx, dy, dz)
        distance = rays.t[ray] * length
        way = (memory.normals[3, i], memory.normals[4, i], memory.normals[5, i])
        start = _lifted(_place_met(rays, d, distance), way, distance)
        _want(packet, which, i, start, distance)
    trace_along(frame.scene, packet, overhang_way(), RAY_NEAR_M, OVERHANG_M, rays.skip, False)
    for k in range(packet.wanted[0]):
        if packet.met[k] >= _ZERO:
            memory.free[which[k]] = overhang_share(packet.met[k])


@device
def _see_sky(light, rays, memory, order, begin, count):  # type: ignore[no-untyped-def]
    """What the rays see that met nothing; the loop that has no branches runs eight at a time."""
    sky, seen, which = memory.sky, memory.seen, memory.which
    met = 0
    for k in range(count):
        i = order[begin + k]
        if rays.row[i] == NOTHING:
            for axis in range(3):
                sky[axis, met] = rays.directions[i, axis]
            which[met] = k
            met += 1
    for j in range(met):
        dx, dy, dz, _ = _unit_of(sky[0, j], sky[1, j], sky[2, j])
        sky[0, j], sky[1, j], sky[2, j] = dx, dy, dz
        sky[3, j], sky[4, j] = sky_place(light, dx, dy, dz)
    for j in range(met):
        k, d = which[j], (sky[0, j], sky[1, j], sky[2, j])
        colour = radiance_at(light, sky[3, j], sky[4, j])
        seen[0, k], seen[1, k], seen[2, k] = _sky_met(light, d, rays.pixel_angle, colour)
        seen[_DISTANCE, k], seen[_RISE, k] = _SKY_M, d[2]
        seen[_SUNWARDS, k] = _towards_sun(light, d)


@device
def _expose_packet(light, rays, memory, order, begin, count, out):  # type: ignore[no-untyped-def]
    """Display light of what a packet met; the loop that has no branches runs eight at a time."""
    seen, height = memory.seen, rays.origin[2]
    for k in range(count):
        seen[0, k], seen[1, k], seen[2, k] = _through_fog(
            light, height, seen[_RISE, k], seen[_SUNWARDS, k], seen[_DISTANCE, k],
            (seen[0, k], seen[1, k], seen[2, k]),
        )  # fmt: skip
    if light.rain > 0:
        for k in range(count):
            dx, dy, dz, _ = _unit(rays.directions, order[begin + k])
            seen[0, k], seen[1, k], seen[2, k] = _through_rain(
                light,
                rays,
                (dx, dy, dz),
                seen[_DISTANCE, k],
                (seen[0, k], seen[1, k], seen[2, k]),
            )
    for k in range(count):
        seen[0, k], seen[1, k], seen[2, k] = _exposed(light, (seen[0, k], seen[1, k], seen[2, k]))
    for k in range(count):
        for channel in range(3):
            out[order[begin + k], channel] = seen[channel, k]


@device
def shade_packets(frame, rays, memory, epic, order, starts, first, last, out):  # type: ignore[no-untyped-def]
    """As :func:`shade_rays`, of rays that run side by side.

    Args:
        frame, rays, epic, out: as there.
        memory: a :class:`ShadeScratch` of this thread.
        order, starts: packets, see :func:`carstage_sim.render.packets.cast_packets`.
        first, last: half-open range of packets.
    """
    light = frame.light
    lamps_on = _lamps_on(frame)
    for number in range(first, last, _PACKETS):
        begin = starts[number]
        count = starts[min(number + _PACKETS, last)] - begin
        _find_light(frame, rays, memory, order, begin, count, epic)
        _see_sky(light, rays, memory, order, begin, count)
        for k in range(count):
            i = order[begin + k]
            if rays.row[i] == NOTHING:
                continue
            dx, dy, dz, length = _unit(rays.directions, i)
            d = (dx, dy, dz)
            distance = rays.t[i] * length
            met, seen = memory.normals, memory.seen
            normals = (
                met[0, k], met[1, k], met[2, k], met[3, k], met[4, k], met[5, k],
                memory.leaves[k],
            )  # fmt: skip
            r, g, b = _hit_radiance(
                frame, rays, memory.packet.single, epic, lamps_on, i, d, distance, normals,
                memory.free[k], memory.sunlit[k],
            )  # fmt: skip
            seen[0, k], seen[1, k], seen[2, k] = r, g, b
            seen[_DISTANCE, k], seen[_RISE, k] = distance, d[2]
            seen[_SUNWARDS, k] = _towards_sun(light, d)
        _expose_packet(light, rays, memory, order, begin, count, out)
