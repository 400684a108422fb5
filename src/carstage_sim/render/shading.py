"""From hits to colours: sun with traced shadows, sky, reflections, lamps, fog, tone curve."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from carstage_sim.render.cast import _STACK, NOTHING, trace
from carstage_sim.render.jit import device, kernel
from carstage_sim.render.simd import LANES

_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)


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
    p, q = light.sky[i], light.sky[i + 1]
    low0 = p[j, 0] + (p[k, 0] - p[j, 0]) * b
    low1 = p[j, 1] + (p[k, 1] - p[j, 1]) * b
    low2 = p[j, 2] + (p[k, 2] - p[j, 2]) * b
    high0 = q[j, 0] + (q[k, 0] - q[j, 0]) * b
    high1 = q[j, 1] + (q[k, 1] - q[j, 1]) * b
    high2 = q[j, 2] + (q[k, 2] - q[j, 2]) * b
    return low0 + (high0 - low0) * a, low1 + (high1 - low1) * a, low2 + (high2 - low2) * a


@device
def _glow(kind, lamps, light):  # type: ignore[no-untyped-def]
    """Emitted radiance of a lamp, in units of what the camera shows as white, and its colour."""
    night = light.air[5]
    blink = (light.air[7] * np.float32(1.5)) % _ONE < np.float32(0.5)
    if kind == 1 and lamps & 6:
        return np.float32(9.0), np.float32(1.0), np.float32(0.96), np.float32(0.88)
    if kind == 1 and lamps & 1:
        return np.float32(2.0), np.float32(1.0), np.float32(0.96), np.float32(0.9)
    if kind == 2 and lamps & 8:
        return np.float32(4.0), np.float32(1.0), np.float32(0.05), np.float32(0.04)
    if kind == 2 and lamps & 7:
        return np.float32(0.9), np.float32(1.0), np.float32(0.04), np.float32(0.03)
    if ((kind == 3 and lamps & 32) or (kind == 4 and lamps & 16)) and blink:
        return np.float32(3.5), np.float32(1.0), np.float32(0.42), np.float32(0.05)
    if kind == 5 and lamps & 64:
        return np.float32(3.0), np.float32(1.0), np.float32(1.0), np.float32(0.95)
    if kind == 6 and lamps == 0:
        return np.float32(3.2), np.float32(1.0), np.float32(0.07), np.float32(0.04)
    if kind == 7 and lamps == 1:
        return np.float32(3.2), np.float32(1.0), np.float32(0.55), np.float32(0.05)
    if kind == 8 and lamps == 2:
        return np.float32(3.0), np.float32(0.08), np.float32(1.0), np.float32(0.55)
    if kind == 9:
        return np.float32(6.0) * night, np.float32(1.0), np.float32(0.85), np.float32(0.6)
    return _ZERO, _ZERO, _ZERO, _ZERO


@device
def _tone(value):  # type: ignore[no-untyped-def]
    """Exposed light as display light, 0-1: linear in the dark, saturating like film."""
    return _ONE - math.exp(-max(value, _ZERO))


@kernel
def shade_rays(  # type: ignore[no-untyped-def]
    scene, static, actors, colour, light_state, materials, light, origin, directions, skip,
    first, last, t, row, triangle, weights, out,
):  # fmt: skip
    """Colours of the hits ``first`` to ``last``: linear display light, 0-1, into ``out (N, 3)``."""
    stack = np.empty(_STACK, np.int32)
    entries = np.empty(_STACK, np.float32)
    tests = np.empty(3 * LANES, np.float32)
    lx, ly, lz = light.sun_direction[0], light.sun_direction[1], light.sun_direction[2]
    sun_up = light.sun[0] + light.sun[1] + light.sun[2] > np.float32(1e-6)
    exposure = light.air[6]
    for i in range(first, last):
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx / length, dy / length, dz / length
        r, g, b = _ZERO, _ZERO, _ZERO
        distance = np.float32(1e5)
        if row[i] == NOTHING:
            r, g, b = _sky(light, dx, dy, dz)
            towards = dx * lx + dy * ly + dz * lz
            if sun_up and towards > np.float32(0.99996):
                r, g, b = r + light.sun[0] * 40, g + light.sun[1] * 40, b + light.sun[2] * 40
            distance = np.float32(3000.0) / max(dz, np.float32(0.03))
        else:
            distance = t[i] * length
            px, py, pz = (
                origin[0] + dx * distance,
                origin[1] + dy * distance,
                origin[2] + dz * distance,
            )
            who = row[i]
            number = triangle[i]
            surfaces = static if who < 0 else actors
            n = surfaces.normals[number]
            m = surfaces.material[number]
            u, v = weights[i, 0], weights[i, 1]
            w = _ONE - u - v
            nx = u * n[0, 0] + v * n[1, 0] + w * n[2, 0]
            ny = u * n[0, 1] + v * n[1, 1] + w * n[2, 1]
            nz = u * n[0, 2] + v * n[1, 2] + w * n[2, 2]
            cr, cg, cb = materials.colour[m, 0], materials.colour[m, 1], materials.colour[m, 2]
            lamps = 0
            if who >= 0:
                q = scene.rotation[who]
                nx, ny, nz = (
                    q[0, 0] * nx + q[0, 1] * ny + q[0, 2] * nz,
                    q[1, 0] * nx + q[1, 1] * ny + q[1, 2] * nz,
                    q[2, 0] * nx + q[2, 1] * ny + q[2, 2] * nz,
                )
                lamps = light_state[who]
                if materials.painted[m]:
                    cr, cg, cb = colour[who, 0], colour[who, 1], colour[who, 2]
            scale = _ONE / max(math.sqrt(nx * nx + ny * ny + nz * nz), np.float32(1e-6))
            facing = dx * nx + dy * ny + dz * nz
            if facing > 0:
                scale = -scale
            nx, ny, nz = nx * scale, ny * scale, nz * scale
            facing = min(abs(facing * scale), _ONE)
            # Light from above, the side and below, mixed by the normal.
            up = max(nz, _ZERO) ** 2
            down = max(-nz, _ZERO) ** 2
            side = _ONE - up - down
            er = light.ambient[0, 0] * up + light.ambient[1, 0] * side + light.ambient[2, 0] * down
            eg = light.ambient[0, 1] * up + light.ambient[1, 1] * side + light.ambient[2, 1] * down
            eb = light.ambient[0, 2] * up + light.ambient[1, 2] * side + light.ambient[2, 2] * down
            sunny = nx * lx + ny * ly + nz * lz
            lit = False
            if sun_up and sunny > 0:
                lift = np.float32(2e-3) + distance * np.float32(2e-4)
                o = (px + nx * lift, py + ny * lift, pz + nz * lift)
                d = (lx, ly, lz)
                shadow = trace(
                    scene, o, d, np.float32(1e-3), np.float32(400.0), skip, True,
                    stack, entries, tests,
                )  # fmt: skip
                lit = shadow[1] == NOTHING
                if lit:
                    er += light.sun[0] * sunny
                    eg += light.sun[1] * sunny
                    eb += light.sun[2] * sunny
            over_pi = np.float32(1 / math.pi)
            r, g, b = cr * er * over_pi, cg * eg * over_pi, cb * eb * over_pi
            rough = materials.roughness[m]
            f0 = materials.specular[m]
            if rough < np.float32(0.75):
                fresnel = f0 + (_ONE - f0) * (_ONE - facing) ** 5 * (_ONE - rough)
                back = 2 * (dx * nx + dy * ny + dz * nz)
                rx, ry, rz = dx - back * nx, dy - back * ny, dz - back * nz
                sr, sg, sb = _sky(light, rx, ry, rz)
                if rz < np.float32(0.05):
                    # Below the horizon the world reflects, not the sky.
                    ground = min(max((np.float32(0.05) - rz) * 8, _ZERO), _ONE)
                    sr += (light.ambient[2, 0] * over_pi - sr) * ground
                    sg += (light.ambient[2, 1] * over_pi - sg) * ground
                    sb += (light.ambient[2, 2] * over_pi - sb) * ground
                r += (sr - r) * fresnel
                g += (sg - g) * fresnel
                b += (sb - b) * fresnel
                if lit:
                    shine = max(rx * lx + ry * ly + rz * lz, _ZERO)
                    power = 2 / max(rough * rough * rough * rough, np.float32(1e-4))
                    glint = shine ** min(power, np.float32(2000.0)) * min(
                        power * np.float32(0.02), np.float32(20.0)
                    )
                    r += light.sun[0] * glint * fresnel
                    g += light.sun[1] * glint * fresnel
                    b += light.sun[2] * glint * fresnel
            strength, gr, gg, gb = _glow(materials.glow[m], lamps, light)
            if strength > 0:
                strength /= exposure
                r, g, b = r + gr * strength, g + gg * strength, b + gb * strength
        thick = (distance - light.air[1]) * light.air[0]
        if thick > 0:
            fog = _ONE - math.exp(-thick)
            r += (light.fog[0] - r) * fog
            g += (light.fog[1] - g) * fog
            b += (light.fog[2] - b) * fog
        out[i, 0] = _tone(r * exposure)
        out[i, 1] = _tone(g * exposure)
        out[i, 2] = _tone(b * exposure)
