"""What a ray met: the surface's place, normals, colour and gloss, before any light."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from carstage_sim.kernels import device, inlined
from carstage_sim.render.detail import (
    ASPHALT,
    LEAVES,
    PICTURE,
    PLASTER,
    ROOM,
    faded,
    pattern,
)
from carstage_sim.render.leaves import leaf_colour
from carstage_sim.render.panes import half_of, pane_colour, size_of, wall_edges
from carstage_sim.render.pictures import picture_colour, picture_colour_of_actor

_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
_HALF: Any = np.float32(0.5)
_FILM: Any = np.float32(0.35)
"""Share of wet ground that lies under water, where it does not stand."""
_FILM_PER_HEIGHT: Any = np.float32(0.6)
_LEAST_FILM: Any = np.float32(0.05)
"""How that share falls with the height of stones, and what of it is left on their tops."""
_RIM: Any = np.float32(0.12)
"""Height of stones beside that of the ground's waves."""


@inlined
def normals_at(scene, surfaces, hit_actor, number, u, v):  # type: ignore[no-untyped-def]
    """Normal between a triangle's corners, of any length, and the triangle's own, in the world.

    Arguments are those of :func:`facing_normals`, which turns them to the ray's origin.
    """
    w = _ONE - u - v
    n = surfaces.normals
    nx = u * n[number, 0, 0] + v * n[number, 1, 0] + w * n[number, 2, 0]
    ny = u * n[number, 0, 1] + v * n[number, 1, 1] + w * n[number, 2, 1]
    nz = u * n[number, 0, 2] + v * n[number, 1, 2] + w * n[number, 2, 2]
    gx, gy, gz = surfaces.flat[number, 0], surfaces.flat[number, 1], surfaces.flat[number, 2]
    if hit_actor >= 0:
        q = scene.rotation
        nx, ny, nz = (
            q[hit_actor, 0, 0] * nx + q[hit_actor, 0, 1] * ny + q[hit_actor, 0, 2] * nz,
            q[hit_actor, 1, 0] * nx + q[hit_actor, 1, 1] * ny + q[hit_actor, 1, 2] * nz,
            q[hit_actor, 2, 0] * nx + q[hit_actor, 2, 1] * ny + q[hit_actor, 2, 2] * nz,
        )
        gx, gy, gz = (
            q[hit_actor, 0, 0] * gx + q[hit_actor, 0, 1] * gy + q[hit_actor, 0, 2] * gz,
            q[hit_actor, 1, 0] * gx + q[hit_actor, 1, 1] * gy + q[hit_actor, 1, 2] * gz,
            q[hit_actor, 2, 0] * gx + q[hit_actor, 2, 1] * gy + q[hit_actor, 2, 2] * gz,
        )
    return nx, ny, nz, gx, gy, gz


@inlined
def turned_normals(n, g, solid, d):  # type: ignore[no-untyped-def]
    """Unit normals towards the origin of a ray ``d``, without a branch; see :func:`normals_at`.

    ``solid`` is 0 for leaves, which keep the normals of their crown, and else 1.
    """
    nx, ny, nz = n
    gx, gy, gz = g
    dx, dy, dz = d
    turn = -_ONE if (gx * dx + gy * dy + gz * dz) * solid > 0 else _ONE
    gx, gy, gz = gx * turn, gy * turn, gz * turn
    turn = -_ONE if (nx * gx + ny * gy + nz * gz) * solid < 0 else _ONE
    nx, ny, nz = nx * turn, ny * turn, nz * turn
    beyond = max(nx * dx + ny * dy + nz * dz + np.float32(0.02), _ZERO) * solid
    nx, ny, nz = nx - beyond * dx, ny - beyond * dy, nz - beyond * dz
    scale = _ONE / max(math.sqrt(nx * nx + ny * ny + nz * nz), np.float32(1e-6))
    return nx * scale, ny * scale, nz * scale, gx, gy, gz


@device
def facing_normals(scene, surfaces, hit_actor, number, u, v, leaves, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Shading normal and triangle's normal in the world, both towards the ray's origin.

    Args:
        scene: a :class:`carstage_sim.render.cast.Scene`.
        surfaces: of the geometry that was met.
        hit_actor: instance row, negative for static geometry.
        number: triangle.
        u, v: weights of its first and second corner.
        leaves: leaves keep the normals of their crown, wherever they face.
        dx, dy, dz: the ray's unit direction.

    Returns:
        ``(nx, ny, nz, gx, gy, gz)``, unit vectors.
    """
    nx, ny, nz, gx, gy, gz = normals_at(scene, surfaces, hit_actor, number, u, v)
    solid = _ZERO if leaves else _ONE
    return turned_normals((nx, ny, nz), (gx, gy, gz), solid, (dx, dy, dz))


@inlined
def surface_material(frame, surfaces, hit, p, n, d, pixel):  # type: ignore[no-untyped-def]
    """What the surface is made of at a place.

    Args:
        frame: a :class:`carstage_sim.render.shading.ShadedFrame`.
        surfaces: of the geometry that was met.
        hit: instance row, triangle, weights of its first and second corner.
        p: the place, world metres.
        n: unit normal there.
        d: the ray's unit direction.
        pixel: a pixel's side on the surface, metres.

    Returns:
        ``(kind, red, green, blue, roughness, specular, lit red, lit green, lit blue)``: the
        procedural pattern, or ``ROOM`` behind glass, linear colour, reflectance at normal
        incidence, and light of a lit room behind a window.
    """
    hit_actor, number, u, v = hit
    appearance, materials, colour = frame.appearance, frame.materials, frame.colour
    m = surfaces.material[number]
    owner = int(surfaces.object_id[number])
    slot = materials.paint[m]
    kind = materials.detail[m]
    cr, cg, cb = materials.colour[m, 0], materials.colour[m, 1], materials.colour[m, 2]
    if hit_actor >= 0 and slot >= 0:
        cr, cg, cb = (
            colour[hit_actor, slot, 0],
            colour[hit_actor, slot, 1],
            colour[hit_actor, slot, 2],
        )
    if hit_actor < 0 and appearance.paint[owner, 3] > 0:
        cr, cg, cb = (
            appearance.paint[owner, 0],
            appearance.paint[owner, 1],
            appearance.paint[owner, 2],
        )
        kind = 0
        if appearance.paint[owner, 3] > _ONE:
            drawn = int(appearance.paint[owner, 3]) - 2
            cr, cg, cb = picture_colour(appearance.pictures, appearance.texels, drawn, p, n, pixel)
    elif kind == PICTURE:
        kind = 0
        cr, cg, cb = picture_colour_of_actor(
            frame.scene.rotation, frame.scene.position, appearance.pictures, appearance.texels,
            (hit_actor, owner), p, n, pixel,
        )  # fmt: skip
    rough, f0 = materials.roughness[m], materials.specular[m]
    er, eg, eb = _ZERO, _ZERO, _ZERO
    packed = int(surfaces.pane[number])
    if packed and kind and kind != PLASTER and hit_actor < 0:
        half = half_of(packed)
        # Corner weights of the two halves of a quad give a place in its rectangle.
        if half == 1:
            s, up_share = _ONE - u, _ONE - u - v
        else:
            s, up_share = v, _ONE - u
        pane = number - (half - 1)
        # Along the wall, up, and into the room.
        view = (d[1] * n[0] - d[0] * n[1], d[2], -(d[0] * n[0] + d[1] * n[1]))
        opaque, cr, cg, cb, er, eg, eb = pane_colour(
            kind, s, up_share, size_of(packed), pane, pixel, frame.light.night, view
        )
        if opaque > _HALF:
            rough, f0 = np.float32(0.8), np.float32(0.03)
        else:
            kind = ROOM
    elif materials.cells[m]:
        fr, fg, fb = leaf_colour(materials.cells[m], owner, number, u, v, pixel)
        cr, cg, cb = cr * fr, cg * fg, cb * fb
    elif kind and hit_actor < 0:
        edges = wall_edges(packed, u, v)
        fr, fg, fb = pattern(kind, p[0], p[1], p[2], n[0], n[1], n[2], edges, owner, number, pixel)
        cr, cg, cb = cr * fr, cg * fg, cb * fb
    return kind, cr, cg, cb, rough, f0, er, eg, eb


@device
def water(light, kind, height, px, py, pixel):  # type: ignore[no-untyped-def]
    """Share of standing water, 0-1, at a place of the ground: puddles, else a film.

    ``height``: of the stones there, about -1 to 1.
    """
    # A film that is thinner than the texture lies between the stones, whose tops stand out of it.
    film = light.wetness * min(max(_FILM - _FILM_PER_HEIGHT * height, _LEAST_FILM), _ONE)
    if light.puddles <= 0:
        return film
    depth = np.float32(0.62) if kind == ASPHALT else np.float32(0.25)
    level = faded(px, py, np.float32(4.3), pixel, 21) + np.float32(0.45) * faded(
        px, py, np.float32(1.1), pixel, 22
    )
    # Stones stand out of a puddle's rim, too.
    level += light.puddles * np.float32(1.5) * depth - _RIM * height
    return min(max((level - np.float32(0.55)) * np.float32(5), film), _ONE)


@device
def is_leaf(kind):  # type: ignore[no-untyped-def]
    """Whether a pattern is that of leaves."""
    return kind == LEAVES
