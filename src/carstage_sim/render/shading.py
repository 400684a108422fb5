"""From hits to colours: sun with traced shadows, sky, reflections, lamps, fog, film curve."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from carstage_sim.jit import device, kernel
from carstage_sim.render.cast import NOTHING, trace
from carstage_sim.render.detail import ASPHALT, LEAVES, WINDOW, faded, pattern, window
from carstage_sim.render.lamps import glow, lamp_light
from carstage_sim.render.materials import Glow

_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
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


@kernel
def shade_rays(  # type: ignore[no-untyped-def]
    scene, scratch, static, actors, looks, colour, light_state, materials, light, lamps, origin,
    directions, skip, pixel_angle, first, last, t, row, triangle, weights, out,
):  # fmt: skip
    """Colours of the hits ``first`` to ``last``: linear display light, 0-1, into ``out (N, 3)``."""
    lx, ly, lz = light.sun_direction[0], light.sun_direction[1], light.sun_direction[2]
    sun_up = light.sun[0] + light.sun[1] + light.sun[2] > np.float32(1e-6)
    wet, puddles, night, exposure = light.wetness, light.puddles, light.night, light.exposure
    lamps_on = night > 0
    for k in range(lamps.power.shape[0]):
        lamps_on = lamps_on or lamps.power[k, 0] + lamps.power[k, 1] + lamps.power[k, 2] > 0
    for i in range(first, last):
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx / length, dy / length, dz / length
        who = row[i]
        if who == NOTHING:
            r, g, b = _sky(light, dx, dy, dz)
            towards = dx * lx + dy * ly + dz * lz
            if sun_up and towards > np.float32(0.99996):
                r, g, b = r + light.sun[0] * 40, g + light.sun[1] * 40, b + light.sun[2] * 40
            distance = np.float32(2500.0) * (_ONE - min(max(dz, _ZERO) * 4, _ONE)) ** 2
        else:
            distance = t[i] * length
            px, py, pz = (
                origin[0] + dx * distance,
                origin[1] + dy * distance,
                origin[2] + dz * distance,
            )
            number = triangle[i]
            surfaces = static if who < 0 else actors
            m = surfaces.material[number]
            u, v = weights[i, 0], weights[i, 1]
            w = _ONE - u - v
            n = surfaces.normals
            nx = u * n[number, 0, 0] + v * n[number, 1, 0] + w * n[number, 2, 0]
            ny = u * n[number, 0, 1] + v * n[number, 1, 1] + w * n[number, 2, 1]
            nz = u * n[number, 0, 2] + v * n[number, 1, 2] + w * n[number, 2, 2]
            gx, gy, gz = (
                surfaces.flat[number, 0],
                surfaces.flat[number, 1],
                surfaces.flat[number, 2],
            )
            bits = 0
            owner = int(surfaces.object_id[number])
            slot = materials.paint[m]
            if who >= 0:
                q = scene.rotation
                nx, ny, nz = (
                    q[who, 0, 0] * nx + q[who, 0, 1] * ny + q[who, 0, 2] * nz,
                    q[who, 1, 0] * nx + q[who, 1, 1] * ny + q[who, 1, 2] * nz,
                    q[who, 2, 0] * nx + q[who, 2, 1] * ny + q[who, 2, 2] * nz,
                )
                gx, gy, gz = (
                    q[who, 0, 0] * gx + q[who, 0, 1] * gy + q[who, 0, 2] * gz,
                    q[who, 1, 0] * gx + q[who, 1, 1] * gy + q[who, 1, 2] * gz,
                    q[who, 2, 0] * gx + q[who, 2, 1] * gy + q[who, 2, 2] * gz,
                )
                bits = light_state[who]
            if who >= 0 and slot >= 0:
                cr, cg, cb = colour[who, slot, 0], colour[who, slot, 1], colour[who, slot, 2]
            else:
                cr, cg, cb = materials.colour[m, 0], materials.colour[m, 1], materials.colour[m, 2]
            kind = materials.detail[m]
            if who < 0 and looks.paint[owner, 3] > 0:
                cr, cg, cb = looks.paint[owner, 0], looks.paint[owner, 1], looks.paint[owner, 2]
                kind = 0
            leaves = kind == LEAVES
            # The side that the ray met is the outside; leaves keep the normals of their crown.
            if not leaves:
                if gx * dx + gy * dy + gz * dz > 0:
                    gx, gy, gz = -gx, -gy, -gz
                if nx * gx + ny * gy + nz * gz < 0:
                    nx, ny, nz = -nx, -ny, -nz
                beyond = nx * dx + ny * dy + nz * dz
                if beyond > np.float32(-0.02):
                    beyond += np.float32(0.02)
                    nx, ny, nz = nx - beyond * dx, ny - beyond * dy, nz - beyond * dz
            scale = _ONE / max(math.sqrt(nx * nx + ny * ny + nz * nz), np.float32(1e-6))
            nx, ny, nz = nx * scale, ny * scale, nz * scale
            facing = min(abs(dx * nx + dy * ny + dz * nz), _ONE)
            pixel = (
                distance
                * pixel_angle
                / max(abs(dx * gx + dy * gy + dz * gz), np.float32(0.06)) ** np.float32(0.7)
            )
            rough = materials.roughness[m]
            f0 = materials.specular[m]
            emitted = _ZERO
            half = surfaces.quad_half[number]
            if kind == WINDOW and who < 0 and half:
                # Corner weights of the two halves of a quad give a place in its rectangle.
                if half == 1:
                    s, up_share = v + w, w
                else:
                    s, up_share = v, v + w
                pane = number - (half - 1)
                part, cr, cg, cb, emitted = window(s, up_share, pane, pixel, night)
                if part == 1:
                    rough, f0 = np.float32(0.8), np.float32(0.03)
            elif kind and who < 0:
                fr, fg, fb = pattern(kind, px, py, pz, nx, ny, nz, owner, number, pixel)
                cr, cg, cb = cr * fr, cg * fg, cb * fb
            if wet > 0 and nz > np.float32(0.5) and who < 0 and not leaves:
                pool = max(wet * np.float32(0.6), puddles) if puddles > 0 else wet * np.float32(0.4)
                if puddles > 0 and kind == ASPHALT:
                    level = faded(px, py, np.float32(3.1), pixel, 21) + np.float32(0.5) * faded(
                        px, py, np.float32(0.8), pixel, 22
                    )
                    pool = min(
                        max(
                            (level + puddles * np.float32(1.6) - np.float32(0.9)) * 4,
                            wet * np.float32(0.4),
                        ),
                        _ONE,
                    )
                soaked = _ONE - np.float32(0.42) * wet
                cr, cg, cb = cr * soaked, cg * soaked, cb * soaked
                rough = rough + (np.float32(0.08) - rough) * pool
            # Light from above, the side and below, mixed by the normal.
            up = max(nz, _ZERO) ** 2
            down = max(-nz, _ZERO) ** 2
            side = _ONE - up - down
            ambient = light.ambient
            er = ambient[0, 0] * up + ambient[1, 0] * side + ambient[2, 0] * down
            eg = ambient[0, 1] * up + ambient[1, 1] * side + ambient[2, 1] * down
            eb = ambient[0, 2] * up + ambient[1, 2] * side + ambient[2, 2] * down
            lift = np.float32(2e-3) + distance * np.float32(2e-4)
            o = (px + gx * lift, py + gy * lift, pz + gz * lift)
            if who < 0 and gz > np.float32(0.7) and distance < np.float32(90.0):
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
                if leaves:
                    away = np.float32(0.25)
                    o = (px + lx * away, py + ly * away, pz + lz * away)
                shadow = trace(
                    scene, scratch, o, (lx, ly, lz), np.float32(1e-3), np.float32(300.0),
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
                fresnel = f0 + (_ONE - f0) * (_ONE - facing) ** 5 * smooth * smooth
                back = 2 * (dx * nx + dy * ny + dz * nz)
                rx, ry, rz = dx - back * nx, dy - back * ny, dz - back * nz
                sr, sg, sb = _sky(light, rx, ry, rz)
                if rz < np.float32(0.12):
                    # Near and below the horizon the town reflects, not the sky.
                    ground = min(max((np.float32(0.12) - rz) * 5, _ZERO), _ONE)
                    sr += (ambient[2, 0] * _OVER_PI - sr) * ground
                    sg += (ambient[2, 1] * _OVER_PI - sg) * ground
                    sb += (ambient[2, 2] * _OVER_PI - sb) * ground
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
            strength, sr, sg, sb = glow(materials.glow[m], bits, light.time_s)
            if who < 0:
                lamp = looks.lamp[owner]
                if lamp >= 0 and materials.glow[m] == _STREET_LAMP:
                    strength = np.float32(6.0)
                    sr, sg, sb = lamps.power[lamp, 0], lamps.power[lamp, 1], lamps.power[lamp, 2]
                r += looks.glow[owner, 0] * 3 / exposure
                g += looks.glow[owner, 1] * 3 / exposure
                b += looks.glow[owner, 2] * 3 / exposure
            if emitted > 0:
                strength, sr, sg, sb = (
                    emitted * np.float32(1.1),
                    _ONE,
                    np.float32(0.74),
                    np.float32(0.42),
                )
            if strength > 0:
                strength /= exposure
                r, g, b = r + sr * strength, g + sg * strength, b + sb * strength
        thick = (distance - light.fog_from_m) * light.fog_per_m
        if thick > 0:
            fog = _ONE - math.exp(-thick)
            r += (light.fog[0] - r) * fog
            g += (light.fog[1] - g) * fog
            b += (light.fog[2] - b) * fog
        out[i, 0] = _film(r * exposure)
        out[i, 1] = _film(g * exposure)
        out[i, 2] = _film(b * exposure)
