"""From hits to colours: sun with traced shadows, sky, reflections, lamps, fog, film curve.

Two qualities share the code. Low traces one shadow ray, one short ray that finds what stands right
above the ground, and mirrors the town in water only; epic feels the sky with three rays and mirrors
the town in all that is glossy.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from carstage_sim.kernels import device, kernel
from carstage_sim.render.cast import NOTHING, trace
from carstage_sim.render.detail import hash_unit, noise
from carstage_sim.render.lamps import glow, lamp_light
from carstage_sim.render.materials import Glow
from carstage_sim.render.surface import facing_normals, is_leaf, surface_material, water
from carstage_sim.render.weathering import fog_share, rain_share

_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
_HALF: Any = np.float32(0.5)
_OVER_PI: Any = np.float32(1 / math.pi)
_STREET_LAMP = int(Glow.STREET_LAMP)


@device
def _sky(light, x, y, z):  # type: ignore[no-untyped-def]
    """Radiance of the sky in a unit direction; below the horizon that of the horizon."""
    rows, columns = light.sky.shape[0], light.sky.shape[1]
    elevation = math.asin(min(max(z, _ZERO), _ONE)) * np.float32(2 / math.pi)
    row = math.sqrt(elevation) * np.float32(rows - 1)
    turn = math.atan2(y, x) * np.float32(0.5 / math.pi)
    column = (turn - math.floor(turn)) * np.float32(columns)
    i = min(int(row), rows - 2)
    j = int(column) % columns
    k = (j + 1) % columns
    a = np.float32(row - i)
    b = np.float32(column - math.floor(column))
    p = light.sky
    low0 = p[i, j, 0] + (p[i, k, 0] - p[i, j, 0]) * b
    low1 = p[i, j, 1] + (p[i, k, 1] - p[i, j, 1]) * b
    low2 = p[i, j, 2] + (p[i, k, 2] - p[i, j, 2]) * b
    i += 1
    high0 = p[i, j, 0] + (p[i, k, 0] - p[i, j, 0]) * b
    high1 = p[i, j, 1] + (p[i, k, 1] - p[i, j, 1]) * b
    high2 = p[i, j, 2] + (p[i, k, 2] - p[i, j, 2]) * b
    return low0 + (high0 - low0) * a, low1 + (high1 - low1) * a, low2 + (high2 - low2) * a


@device
def _film(value):  # type: ignore[no-untyped-def]
    """Exposed light as display light, 0-1: linear in the dark, saturating like film."""
    return _ONE - math.exp(-max(value, _ZERO))


@device
def _sky_light(light, nx, ny, nz):  # type: ignore[no-untyped-def]
    """Irradiance from above, the side and below, mixed by the normal."""
    up = max(nz, _ZERO) ** 2
    down = max(-nz, _ZERO) ** 2
    side = _ONE - up - down
    a = light.ambient
    return (
        a[0, 0] * up + a[1, 0] * side + a[2, 0] * down,
        a[0, 1] * up + a[1, 1] * side + a[2, 1] * down,
        a[0, 2] * up + a[1, 2] * side + a[2, 2] * down,
    )


@device
def _openness(scene, scratch, o, nx, ny, nz, skip):  # type: ignore[no-untyped-def]
    """Share of the sky above a surface that nothing near covers, from three rays, 0.2-1."""
    # Two tangents of the normal (Duff et al., JCGT 2017).
    sign = _ONE if nz >= 0 else -_ONE
    a = -_ONE / (sign + nz)
    b = nx * ny * a
    tx, ty, tz = _ONE + sign * nx * nx * a, sign * b, -sign * nx
    bx, by, bz = b, sign + ny * ny * a, -ny
    total = _ZERO
    for k in range(3):
        across = np.float32(0.8) if k == 0 else np.float32(-0.4)
        along = _ZERO if k == 0 else (np.float32(0.69) if k == 1 else np.float32(-0.69))
        ray = (
            nx * np.float32(0.6) + tx * across + bx * along,
            ny * np.float32(0.6) + ty * across + by * along,
            nz * np.float32(0.6) + tz * across + bz * along,
        )
        hit = trace(scene, scratch, o, ray, np.float32(1e-3), np.float32(3.0), skip, False)
        total += min(hit[0] * np.float32(1 / 3), _ONE)
    return np.float32(0.2) + np.float32(0.8 / 3) * total


@device
def _emission(light, materials, appearance, lamps, m, hit_actor, owner, bits, emitted):  # type: ignore[no-untyped-def]
    """Radiance that a surface emits: lamps by their state, lit rooms, what clients let glow."""
    strength, r, g, b = glow(materials.glow[m], bits, light.time_s)
    if hit_actor < 0:
        lamp = appearance.lamp[owner]
        if lamp >= 0 and materials.glow[m] == _STREET_LAMP:
            strength = np.float32(6.0)
            r, g, b = lamps.power[lamp, 0], lamps.power[lamp, 1], lamps.power[lamp, 2]
    if emitted > 0:
        strength, r, g, b = emitted * np.float32(1.1), _ONE, np.float32(0.74), np.float32(0.42)
    strength *= light.lamp
    r, g, b = r * strength, g * strength, b * strength
    if hit_actor < 0:
        more = np.float32(3) * light.lamp
        r += appearance.glow[owner, 0] * more
        g += appearance.glow[owner, 1] * more
        b += appearance.glow[owner, 2] * more
    return r, g, b


@device
def _mirrored(  # type: ignore[no-untyped-def]
    scene, scratch, static, actors, appearance, colour, light_state, materials, light, lamps,
    o, dx, dy, dz, skip, lamps_on,
):  # fmt: skip
    """Radiance that comes from a unit direction: the sky, or the town without cast shadows."""
    hit = trace(scene, scratch, o, (dx, dy, dz), np.float32(1e-3), np.float32(150.0), skip, False)
    distance, hit_actor, number = hit[0], hit[1], hit[2]
    if hit_actor == NOTHING:
        return _sky(light, dx, dy, dz)
    surfaces = static if hit_actor < 0 else actors
    m = surfaces.material[number]
    owner = int(surfaces.object_id[number])
    leaves = is_leaf(materials.detail[m])
    u, v = hit[3], hit[4]
    nx, ny, nz, _, _, _ = facing_normals(
        scene, surfaces, hit_actor, number, u, v, leaves, dx, dy, dz
    )
    px, py, pz = o[0] + dx * distance, o[1] + dy * distance, o[2] + dz * distance
    _, cr, cg, cb, _, f0, emitted = surface_material(
        surfaces, appearance, colour, materials, light.night, hit_actor, number, u, v, px, py, pz,
        nx, ny, nz, np.float32(0.1) + distance * np.float32(0.01),
    )  # fmt: skip
    er, eg, eb = _sky_light(light, nx, ny, nz)
    s = light.sun_direction
    sunny = max(nx * s[0] + ny * s[1] + nz * s[2], _ZERO) * np.float32(0.6)
    er, eg, eb = er + light.sun[0] * sunny, eg + light.sun[1] * sunny, eb + light.sun[2] * sunny
    if lamps_on:
        lr, lg, lb = lamp_light(lamps, light.night, px, py, pz, nx, ny, nz)
        er, eg, eb = er + lr, eg + lg, eb + lb
    r, g, b = cr * er * _OVER_PI, cg * eg * _OVER_PI, cb * eb * _OVER_PI
    if f0 > np.float32(0.07):
        # Glass and metal mirror in turn: about the sky at the side.
        a = light.ambient
        r += (a[1, 0] * _OVER_PI - r) * f0
        g += (a[1, 1] * _OVER_PI - g) * f0
        b += (a[1, 2] * _OVER_PI - b) * f0
    bits = light_state[hit_actor] if hit_actor >= 0 else 0
    lr, lg, lb = _emission(light, materials, appearance, lamps, m, hit_actor, owner, bits, emitted)
    r, g, b = r + lr, g + lg, b + lb
    fog = fog_share(light, o[2], dz, distance)
    return (
        r + (light.fog[0] - r) * fog,
        g + (light.fog[1] - g) * fog,
        b + (light.fog[2] - b) * fog,
    )


@kernel
def shade_rays(  # type: ignore[no-untyped-def]
    scene, scratch, static, actors, appearance, colour, light_state, materials, light, lamps,
    origin, directions, skip, pixel_angle, epic, first, last, t, row, triangle, weights, out,
):  # fmt: skip
    """Colours of the hits ``first`` to ``last``: linear display light, 0-1, into ``out (N, 3)``."""
    lx, ly, lz = light.sun_direction[0], light.sun_direction[1], light.sun_direction[2]
    sun_up = light.sun[0] + light.sun[1] + light.sun[2] > np.float32(1e-6)
    wet, night, exposure = light.wetness, light.night, light.exposure
    lamps_on = night > 0
    for k in range(lamps.power.shape[0]):
        lamps_on = lamps_on or lamps.power[k, 0] + lamps.power[k, 1] + lamps.power[k, 2] > 0
    for i in range(first, last):
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx / length, dy / length, dz / length
        towards = dx * lx + dy * ly + dz * lz
        hit_actor = row[i]
        if hit_actor == NOTHING:
            r, g, b = _sky(light, dx, dy, dz)
            if sun_up and towards > np.float32(0.99996):
                r, g, b = r + light.sun[0] * 40, g + light.sun[1] * 40, b + light.sun[2] * 40
            distance = np.float32(2500.0)
        else:
            distance = t[i] * length
            px, py, pz = (
                origin[0] + dx * distance,
                origin[1] + dy * distance,
                origin[2] + dz * distance,
            )
            number = triangle[i]
            surfaces = static if hit_actor < 0 else actors
            m = surfaces.material[number]
            leaves = is_leaf(materials.detail[m])
            nx, ny, nz, gx, gy, gz = facing_normals(
                scene, surfaces, hit_actor, number, weights[i, 0], weights[i, 1], leaves, dx, dy, dz
            )
            pixel = (
                distance
                * pixel_angle
                / max(abs(dx * gx + dy * gy + dz * gz), np.float32(0.06)) ** np.float32(0.7)
            )
            kind, cr, cg, cb, rough, f0, emitted = surface_material(
                surfaces, appearance, colour, materials, night, hit_actor, number, weights[i, 0],
                weights[i, 1], px, py, pz, nx, ny, nz, pixel,
            )  # fmt: skip
            if is_leaf(kind) and light.wind > 0:
                # Wind turns leaves to and from the light.
                beat = math.sin(light.time_s * 9 + hash_unit(number, 5, 77) * 40)
                flutter = _ONE + np.float32(0.4) * light.wind * beat
                cr, cg, cb = cr * flutter, cg * flutter, cb * flutter
            pool = _ZERO
            if wet > 0 and nz > np.float32(0.5) and hit_actor < 0 and not leaves:
                pool = water(light, kind, px, py, pixel)
                soaked = _ONE - np.float32(0.5) * wet
                cr, cg, cb = cr * soaked, cg * soaked, cb * soaked
                rough = rough + (np.float32(0.06) - rough) * min(pool * 2, _ONE)
                # Water is level; drops and the stones under a film let it tremble.
                rough_water = (_ONE - pool) * np.float32(0.06) + light.rain * np.float32(0.02)
                tremble = rough_water * min(np.float32(0.05) / pixel, _ONE)
                nx += tremble * noise(px * 23, py * 23, 31)
                ny += tremble * noise(px * 23, py * 23, 32)
            er, eg, eb = _sky_light(light, nx, ny, nz)
            lift = np.float32(2e-3) + distance * np.float32(2e-4)
            o = (px + gx * lift, py + gy * lift, pz + gz * lift)
            if epic and not leaves and distance < np.float32(60.0):
                free = _openness(scene, scratch, o, gx, gy, gz, skip)
                er, eg, eb = er * free, eg * free, eb * free
            elif hit_actor < 0 and gz > np.float32(0.7) and distance < np.float32(90.0):
                # What stands right above keeps the sky's light off the ground.
                under = trace(
                    scene, scratch, o, (np.float32(0.12), np.float32(0.09), _ONE), np.float32(1e-3),
                    np.float32(0.7), skip, True,
                )  # fmt: skip
                if under[1] != NOTHING:
                    dark = np.float32(0.30) + np.float32(0.4) * under[0]
                    er, eg, eb = er * dark, eg * dark, eb * dark
            sunny = nx * lx + ny * ly + nz * lz
            if leaves:
                # Leaves let light through: the crown's dark side is not black.
                sunny = max(sunny * np.float32(0.7) + np.float32(0.3), np.float32(0.12))
            lit = False
            if sun_up and sunny > 0 and (leaves or gx * lx + gy * ly + gz * lz > 0):
                start = o
                if leaves:
                    away = np.float32(0.25)
                    start = (px + lx * away, py + ly * away, pz + lz * away)
                shadow = trace(
                    scene, scratch, start, (lx, ly, lz), np.float32(1e-3), np.float32(300.0),
                    skip, True,
                )  # fmt: skip
                lit = shadow[1] == NOTHING
                if lit:
                    er += light.sun[0] * sunny
                    eg += light.sun[1] * sunny
                    eb += light.sun[2] * sunny
                elif leaves:
                    er += light.sun[0] * sunny * np.float32(0.22)
                    eg += light.sun[1] * sunny * np.float32(0.24)
                    eb += light.sun[2] * sunny * np.float32(0.12)
            if lamps_on:
                lr, lg, lb = lamp_light(lamps, night, px, py, pz, nx, ny, nz)
                er, eg, eb = er + lr, eg + lg, eb + lb
            r, g, b = cr * er * _OVER_PI, cg * eg * _OVER_PI, cb * eb * _OVER_PI
            if rough < np.float32(0.75):
                smooth = _ONE - rough
                facing = min(abs(dx * nx + dy * ny + dz * nz), _ONE)
                fresnel = f0 + (_ONE - f0) * (_ONE - facing) ** 5 * smooth * smooth
                back = 2 * (dx * nx + dy * ny + dz * nz)
                rx, ry, rz = dx - back * nx, dy - back * ny, dz - back * nz
                if (
                    fresnel > np.float32(0.02)
                    and distance < np.float32(120.0)
                    and (pool > np.float32(0.1) or (epic and rough < np.float32(0.35)))
                ):
                    sr, sg, sb = _mirrored(
                        scene, scratch, static, actors, appearance, colour, light_state, materials,
                        light, lamps, o, rx, ry, rz, skip, lamps_on,
                    )  # fmt: skip
                else:
                    sr, sg, sb = _sky(light, rx, ry, rz)
                    if rz < np.float32(0.12):
                        # Near and below the horizon the town reflects, not the sky.
                        a = light.ambient
                        ground = min(max((np.float32(0.12) - rz) * 5, _ZERO), _ONE)
                        sr += (a[2, 0] * _OVER_PI - sr) * ground
                        sg += (a[2, 1] * _OVER_PI - sg) * ground
                        sb += (a[2, 2] * _OVER_PI - sb) * ground
                r += (sr - r) * fresnel
                g += (sg - g) * fresnel
                b += (sb - b) * fresnel
                if lit:
                    shine = max(rx * lx + ry * ly + rz * lz, _ZERO)
                    power = min(2 / max(rough**4, np.float32(1e-3)), np.float32(2000.0))
                    glint = shine**power * (power + 2) * np.float32(0.02) * fresnel
                    r += light.sun[0] * glint
                    g += light.sun[1] * glint
                    b += light.sun[2] * glint
            owner = int(surfaces.object_id[number])
            bits = light_state[hit_actor] if hit_actor >= 0 else 0
            lr, lg, lb = _emission(
                light, materials, appearance, lamps, m, hit_actor, owner, bits, emitted
            )
            r, g, b = r + lr, g + lg, b + lb
        fog = fog_share(light, origin[2], dz, distance)
        if fog > 0:
            halo = max(towards, _ZERO) ** 8
            r += (light.fog[0] + light.fog_glow[0] * halo - r) * fog
            g += (light.fog[1] + light.fog_glow[1] * halo - g) * fog
            b += (light.fog[2] + light.fog_glow[2] * halo - b) * fog
        if light.rain > 0:
            veil = rain_share(light, dx, dy, dz, distance, pixel_angle)
            a = light.ambient
            r += ((a[1, 0] * _OVER_PI + light.fog[0]) * _HALF - r) * veil
            g += ((a[1, 1] * _OVER_PI + light.fog[1]) * _HALF - g) * veil
            b += ((a[1, 2] * _OVER_PI + light.fog[2]) * _HALF - b) * veil
        out[i, 0] = _film(r * exposure)
        out[i, 1] = _film(g * exposure)
        out[i, 2] = _film(b * exposure)
