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

from carstage_sim.kernels import device, inlined
from carstage_sim.mesh import Material
from carstage_sim.render.arithmetic import exp_down, power_of_slant
from carstage_sim.render.cast import NOTHING, Scene, trace
from carstage_sim.render.detail import ASPHALT, GLAZING, ROOM, hash_unit, stones
from carstage_sim.render.incoming_light import (
    OVER_PI,
    openness,
    sees_sun,
    sky_irradiance,
    sky_radiance,
    sun_is_up,
    sun_may_reach,
    sun_start,
    under_overhang,
)
from carstage_sim.render.joined_models import Surfaces
from carstage_sim.render.lamps import Lamps, glow, lamp_light
from carstage_sim.render.materials import Glow, MaterialTable, Paint
from carstage_sim.render.object_appearance import ObjectAppearance
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
SKY_M: Any = np.float32(2500.0)
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
_INDOOR_SKY: Any = np.float32(0.24)
_INDOOR_SUN: Any = np.float32(0.16)
"""Shares of the light that come to the inside of a car.

Panes are a fifth of the walls around a cabin, a third of what somebody beside one sees, and let
three quarters of the light in.
"""
_PANE: Any = np.float32(0.68)
_TINTED_PANE: Any = np.float32(0.22)
"""Shares of the light that a pane lets through, the second of privacy glass."""
_TINTED = int(Material.GLASS_TINTED)
_TWO: Any = np.float32(2)
_BEYOND_PANE_M: Any = np.float32(5e-3)
_ROOM_SUN: Any = np.float32(0.3)
"""Share of the sun that comes to rooms of houses, where its shadows would lie on the pane."""
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
_STONES_PER_M: Any = np.float32(23)
_STONE_SLOPE: Any = np.float32(0.1)
"""Slope of a road's stones: a texture 0.8 mm deep (ISO 13473-1) of stones 8 mm apart."""
_WATER_ROUGHNESS: Any = np.float32(0.06)
_LIFT_M: Any = np.float32(2e-3)
_LIFT_PER_M: Any = np.float32(2e-4)
"""How far above a surface rays from it begin, and its growth with the distance."""
_LAMP_RADIANCE: Any = np.float32(6.0)
"""Radiance of a street lamp of full power."""
_CLIENT_GLOW: Any = np.float32(3)
"""Radiance of what clients let glow, for each unit of its colour."""
_GLINT: Any = np.float32(0.02)
_SHARPEST_GLINT: Any = np.float32(2000.0)
"""Strength of the sun's reflection, and its greatest exponent."""


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
    r, g, b = r * strength + emitted[0], g * strength + emitted[1], b * strength + emitted[2]
    r, g, b = r * light.lamp, g * light.lamp, b * light.lamp
    if hit_actor < 0:
        more = _CLIENT_GLOW * light.lamp
        r += appearance.glow[owner, 0] * more
        g += appearance.glow[owner, 1] * more
        b += appearance.glow[owner, 2] * more
    return r, g, b


@device
def mirrored(frame, scratch, skip, o, d, lamps_on):  # type: ignore[no-untyped-def]
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
    _, cr, cg, cb, _, f0, lit_r, lit_g, lit_b = surface_material(
        frame, surfaces, (hit_actor, number, u, v), (px, py, pz), (nx, ny, nz), d,
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
    lr, lg, lb = _emission(frame, m, hit_actor, owner, (lit_r, lit_g, lit_b))
    r, g, b = r + lr, g + lg, b + lb
    fog = fog_share(light, o[2], dz, distance)
    return (
        r + (light.fog[0] - r) * fog,
        g + (light.fog[1] - g) * fog,
        b + (light.fog[2] - b) * fog,
    )


@inlined
def _pane(m):  # type: ignore[no-untyped-def]
    """Share of the light that a car's pane of a material lets through."""
    return _TINTED_PANE if m == _TINTED else _PANE


@inlined
def mirrored_by_pane(f0, grazing):  # type: ignore[no-untyped-def]
    """What the two faces of a pane mirror, of which ``f0`` at normal incidence.

    Schlick's approximation of one face; light that goes to and fro between both is added up.
    """
    one = f0 / (_TWO - f0)
    one += (_ONE - one) * grazing
    return _TWO * one / (_ONE + one)


@device
def _seen_through(frame, scratch, skip, o, d, owner, lamps_on):  # type: ignore[no-untyped-def]
    """Radiance from behind a pane: its own object's inside in half light, or what is beyond.

    ``owner``: instance row and level object of the pane.
    """
    light, materials = frame.light, frame.materials
    dx, dy, dz = d
    hit = trace(frame.scene, scratch, o, d, _MIRROR_NEAR_M, _CABIN_M, skip, False)
    distance, hit_actor, number, u, v = hit[0], hit[1], hit[2], hit[3], hit[4]
    surfaces = frame.static if hit_actor < 0 else frame.actors
    inside = hit_actor != NOTHING and hit_actor == owner[0]
    if inside and hit_actor < 0:
        inside = int(surfaces.object_id[number]) == owner[1]
    m = 0
    if inside:
        m = surfaces.material[number]
    px, py, pz = o[0] + dx * distance, o[1] + dy * distance, o[2] + dz * distance
    pane = inside and materials.detail[m] == GLAZING
    if pane or not inside:
        share, beyond = _ONE, o
        if pane:
            share = _pane(m)
            beyond = (px + dx * _BEYOND_PANE_M, py + dy * _BEYOND_PANE_M, pz + dz * _BEYOND_PANE_M)
        r, g, b = mirrored(frame, scratch, skip, beyond, d, lamps_on)
        return r * share, g * share, b * share
    nx, ny, nz, _, _, _ = facing_normals(
        frame.scene, surfaces, hit_actor, number, u, v, False, dx, dy, dz
    )
    _, cr, cg, cb, _, _, _, _, _ = surface_material(
        frame, surfaces, (hit_actor, number, u, v), (px, py, pz), (nx, ny, nz), d,
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
def over_town(light, rise, colour):  # type: ignore[no-untyped-def]
    """Radiance of what mirrors show of the sky: near and below the horizon, of the town."""
    r, g, b = colour
    a = light.ambient
    ground = min(max((_TOWN_HORIZON - rise) * np.float32(5), _ZERO), _ONE)
    return (
        r + (a[2, 0] * OVER_PI - r) * ground,
        g + (a[2, 1] * OVER_PI - g) * ground,
        b + (a[2, 2] * OVER_PI - b) * ground,
    )


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
def _stones_at(p, pixel):  # type: ignore[no-untyped-def]
    """Height of the ground's stones at a place, about -1 to 1, and how it rises along x and y."""
    height, along, across = stones(p[0] * _STONES_PER_M, p[1] * _STONES_PER_M, 31)
    left = min(np.float32(0.05) / pixel, _ONE)
    return height * left, along * left, across * left


@inlined
def _water_on(light, wet, rough, rise, n):  # type: ignore[no-untyped-def]
    """Roughness and the normal's x and y of ground under water.

    ``wet``: share of standing water, and the ground's pattern. ``rise``: of its stones.
    """
    # Water that stands is level; drops let it tremble. A film follows the stones below it.
    pool, kind = wet
    steep = _STONE_SLOPE if kind == ASPHALT else _WATER_ROUGHNESS
    tilt = (_ONE - pool) * steep + light.rain * np.float32(0.02)
    return (
        rough + (_WATER_ROUGHNESS - rough) * min(pool + pool, _ONE),
        n[0] - tilt * rise[0],
        n[1] - tilt * rise[1],
    )


@inlined
def is_covered_ground(row, g, distance):  # type: ignore[no-untyped-def]
    """Whether what may stand right above a surface takes light of the sky from it."""
    return row < 0 and g[2] > _LEVEL_GROUND and distance < _OVERHANG_WITHIN_M


@inlined
def feels_sky(leaves, distance):  # type: ignore[no-untyped-def]
    """Whether a surface's sky is felt by rays, where the picture is worth them."""
    return not leaves and distance < _OPENNESS_WITHIN_M


@inlined
def unit_of(dx, dy, dz):  # type: ignore[no-untyped-def]
    """Unit direction of a vector, and its length."""
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    return dx / length, dy / length, dz / length, length


@inlined
def lifted(p, g, distance):  # type: ignore[no-untyped-def]
    """Where rays from a surface begin."""
    lift = _LIFT_M + distance * _LIFT_PER_M
    return p[0] + g[0] * lift, p[1] + g[1] * lift, p[2] + g[2] * lift


@inlined
def place_met(o, d, distance):  # type: ignore[no-untyped-def]
    """Where a ray from ``o`` of unit direction ``d`` ends."""
    return o[0] + d[0] * distance, o[1] + d[1] * distance, o[2] + d[2] * distance


@inlined
def footprint(pixel_angle, d, g, distance):  # type: ignore[no-untyped-def]
    """A pixel's side on a surface (m) that a ray of unit direction ``d`` meets at a slant."""
    slant = min(max(abs(d[0] * g[0] + d[1] * g[1] + d[2] * g[2]), _LEAST_FACING), _ONE)
    return distance * pixel_angle / power_of_slant(slant)


@inlined
def unmirrored(frame, rays, scratch, epic, lamps_on, i, d, distance, p, pixel, normals, light_met):  # type: ignore[no-untyped-def]
    """Radiance of what ray ``i`` of unit direction ``d`` met, and what it mirrors.

    Args:
        frame, rays, scratch, epic, lamps_on, i, d, distance: of the ray.
        p, pixel: the place and a pixel's side there.
        normals: the shading normal, the triangle's normal, whether it is leaves.
        light_met: share of the sky's light, and whether the sun reaches the place, if it is turned
            to it.

    Returns:
        Radiance without what is mirrored (3), radiance that the surface emits (3), reflectance,
        negative where nothing is mirrored, roughness, direction that is mirrored (3), whether the
        sun shines there, and whether the town is mirrored, not only the sky.
    """
    light = frame.light
    free, sunlit = light_met
    lx, ly, lz = light.sun_direction[0], light.sun_direction[1], light.sun_direction[2]
    dx, dy, dz = d
    px, py, pz = p
    hit_actor, number, u, v = rays.row[i], rays.triangle[i], rays.weights[i, 0], rays.weights[i, 1]
    surfaces = frame.static if hit_actor < 0 else frame.actors
    m = surfaces.material[number]
    nx, ny, nz, gx, gy, gz, leaves = normals
    kind, cr, cg, cb, rough, f0, lit_r, lit_g, lit_b = surface_material(
        frame, surfaces, (hit_actor, number, u, v), (px, py, pz), (nx, ny, nz), d, pixel
    )
    if is_leaf(kind) and light.wind > 0:
        # Wind turns leaves to and from the light.
        beat = math.sin(light.time_s * np.float32(9) + hash_unit(number, 5, 77) * np.float32(40))
        flutter = _ONE + np.float32(0.4) * light.wind * beat
        cr, cg, cb = cr * flutter, cg * flutter, cb * flutter
    pool = _ZERO
    if light.wetness > 0 and nz > _WET_GROUND and hit_actor < 0 and not leaves:
        height, along, across = _stones_at((px, py), pixel)
        pool = water(light, kind, height, px, py, pixel)
        soaked = _ONE - np.float32(0.5) * light.wetness
        cr, cg, cb = cr * soaked, cg * soaked, cb * soaked
        rough, nx, ny = _water_on(light, (pool, kind), rough, (along, across), (nx, ny))
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
            if kind == ROOM:
                sunny *= _ROOM_SUN
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
        o = lifted((px, py, pz), (-gx, -gy, -gz), distance)
        owner = (hit_actor, int(surfaces.object_id[number]))
        tr, tg, tb = _seen_through(frame, scratch, rays.skip, o, d, owner, lamps_on)
        near = _pane(m) * min((_THROUGH_WITHIN_M - distance) * np.float32(0.1), _ONE)
        r, g, b = r + tr * near, g + tg * near, b + tb * near
    fresnel, rx, ry, rz = -_ONE, _ZERO, _ZERO, _ZERO
    town = False
    if rough < _MATT_ROUGHNESS:
        smooth = _ONE - rough
        facing = min(abs(dx * nx + dy * ny + dz * nz), _ONE)
        grazing = _ONE - facing
        square = grazing * grazing
        grazing *= square * square * smooth * smooth
        fresnel = mirrored_by_pane(f0, grazing) if kind == GLAZING else f0 + (_ONE - f0) * grazing
        back = np.float32(2) * (dx * nx + dy * ny + dz * nz)
        rx, ry, rz = dx - back * nx, dy - back * ny, dz - back * nz
        glossy = pool > _MIRRORING_WATER or (epic and rough < _MIRRORING_ROUGHNESS)
        town = glossy and fresnel > _LEAST_FRESNEL and distance < _MIRRORING_M
    owner_id = int(surfaces.object_id[number])
    lr, lg, lb = _emission(frame, m, hit_actor, owner_id, (lit_r, lit_g, lit_b))
    return r, g, b, lr, lg, lb, fresnel, rough, rx, ry, rz, lit, town


@inlined
def with_mirrored(light, colour, shown, gloss, lit):  # type: ignore[no-untyped-def]
    """Radiance with what a surface mirrors.

    Args:
        light: sun and sky.
        colour: radiance without.
        shown: radiance that is mirrored.
        gloss: reflectance, roughness, and cosine of what is mirrored with the sun.
        lit: whether the sun shines there.
    """
    r, g, b = colour
    sr, sg, sb = shown
    fresnel, rough, towards_sun = gloss
    r, g, b = r + (sr - r) * fresnel, g + (sg - g) * fresnel, b + (sb - b) * fresnel
    if lit:
        glint = _glint(towards_sun, rough, fresnel)
        r += light.sun[0] * glint
        g += light.sun[1] * glint
        b += light.sun[2] * glint
    return r, g, b


@inlined
def towards(s, d):  # type: ignore[no-untyped-def]
    """Cosine between two unit directions."""
    return d[0] * s[0] + d[1] * s[1] + d[2] * s[2]


@inlined
def through_fog(light, height, rise, sunwards, distance, colour):  # type: ignore[no-untyped-def]
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
def through_rain(light, rays, d, distance, colour):  # type: ignore[no-untyped-def]
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
def any_lamp_on(frame):  # type: ignore[no-untyped-def]
    """Whether any lamp shines."""
    lamps = frame.lamps
    on = frame.light.night > 0
    for k in range(lamps.power.shape[0]):
        on = on or lamps.power[k, 0] + lamps.power[k, 1] + lamps.power[k, 2] > 0
    return on


@inlined
def sky_met(light, d, pixel_angle, colour):  # type: ignore[no-untyped-def]
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
def exposed(light, colour):  # type: ignore[no-untyped-def]
    """Display light of a colour."""
    r, g, b = colour
    return _film(r * light.exposure), _film(g * light.exposure), _film(b * light.exposure)


@device
def _met(frame, rays, i):  # type: ignore[no-untyped-def]
    """What ray ``i`` met.

    Returns:
        The ray's unit direction (3), distance, shading normal (3), triangle's normal (3), place
        (3), whether it is leaves.
    """
    row, number = rays.row[i], rays.triangle[i]
    ways = rays.directions
    dx, dy, dz, length = unit_of(ways[i, 0], ways[i, 1], ways[i, 2])
    distance = rays.t[i] * length
    surfaces = frame.static if row < 0 else frame.actors
    leaves = is_leaf(frame.materials.detail[surfaces.material[number]])
    nx, ny, nz, gx, gy, gz = facing_normals(
        frame.scene, surfaces, row, number, rays.weights[i, 0], rays.weights[i, 1], leaves,
        dx, dy, dz,
    )  # fmt: skip
    px, py, pz = place_met(rays.origin, (dx, dy, dz), distance)
    return dx, dy, dz, distance, nx, ny, nz, gx, gy, gz, px, py, pz, leaves


@device
def light_reaching(frame, rays, scratch, epic, i):  # type: ignore[no-untyped-def]
    """What comes of sun and sky to the place that ray ``i`` met.

    The card's first pass of shading is made from this; the others' arguments are those of
    :func:`colour_of_ray`.

    Returns:
        Share of the sky's light, 0-1, negative where the sun does not reach the place.
    """
    if rays.row[i] == NOTHING:
        return -_ONE
    _, _, _, distance, nx, ny, nz, gx, gy, gz, px, py, pz, leaves = _met(frame, rays, i)
    light = frame.light
    way, p = (gx, gy, gz), (px, py, pz)
    o = lifted(p, way, distance)
    free = _ONE
    if epic and feels_sky(leaves, distance):
        free = openness(frame.scene, scratch, o, gx, gy, gz, rays.skip)
    elif is_covered_ground(rays.row[i], way, distance):
        free = under_overhang(frame.scene, scratch, o, rays.skip)
    if sun_may_reach(light, (nx, ny, nz), way, leaves):
        start = sun_start(light, p, o, leaves)
        if sees_sun(frame.scene, scratch, light, start, rays.skip):
            return free
    return -free


@device
def colour_of_ray(frame, rays, scratch, epic, lamps_on, i, reaching):  # type: ignore[no-untyped-def]
    """Colour of what ray ``i`` met: linear display light, 0-1. The card's shader is made from this.

    Args:
        frame: a :class:`ShadedFrame`.
        rays: a :class:`RayHits`.
        scratch: working memory of this thread.
        epic: whether the picture is worth more rays.
        lamps_on: whether any lamp shines.
        i: the ray.
        reaching: of :func:`light_reaching`.
    """
    light = frame.light
    if rays.row[i] == NOTHING:
        distance = SKY_M
        ways = rays.directions
        dx, dy, dz, _ = unit_of(ways[i, 0], ways[i, 1], ways[i, 2])
        d = (dx, dy, dz)
        sky = sky_radiance(light, dx, dy, dz)
        r, g, b = sky_met(light, d, rays.pixel_angle, sky)
    else:
        dx, dy, dz, distance, nx, ny, nz, gx, gy, gz, px, py, pz, leaves = _met(frame, rays, i)
        d, p, way = (dx, dy, dz), (px, py, pz), (gx, gy, gz)
        pixel = footprint(rays.pixel_angle, d, way, distance)
        r, g, b, lr, lg, lb, fresnel, rough, rx, ry, rz, lit, town = unmirrored(
            frame, rays, scratch, epic, lamps_on, i, d, distance, p, pixel,
            (nx, ny, nz, gx, gy, gz, leaves), (abs(reaching), reaching > 0),
        )  # fmt: skip
        if fresnel >= 0:
            mirror = (rx, ry, rz)
            if town:
                o = lifted(p, way, distance)
                shown = mirrored(frame, scratch, rays.skip, o, mirror, lamps_on)
            else:
                shown = over_town(light, rz, sky_radiance(light, rx, ry, rz))
            gloss = (fresnel, rough, towards(light.sun_direction, mirror))
            r, g, b = with_mirrored(light, (r, g, b), shown, gloss, lit)
        r, g, b = r + lr, g + lg, b + lb
    sunwards = towards(light.sun_direction, d)
    colour = through_fog(light, rays.origin[2], d[2], sunwards, distance, (r, g, b))
    return exposed(light, through_rain(light, rays, d, distance, colour))
