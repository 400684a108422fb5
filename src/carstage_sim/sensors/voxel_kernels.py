"""Which voxels triangles pass through, and how much of their surface lies in each.

A triangle is in a voxel if the closed triangle meets the box. That is decided without rounding up
or down by the triangle's plane and the edges of its three projections, after Schwarz and Seidel,
Fast Parallel Surface and Solid Voxelization on GPUs (2010), section 4.1. Along the axis on which
the triangle is steepest, the plane alone says which voxels of a column are tried.

All places are in voxels, counted from the grid's lower corner.
"""

from __future__ import annotations

import numpy as np

from carstage_sim.kernels import device, kernel

LANES = 8
"""Triangles of a leaf, and children of a node."""
TAGS = 64
"""A part is ``owner * TAGS + tag``."""
EMPTY = -1
"""Of ``first``: nothing is in the voxel. Further down: the place of a voxel with several parts."""
_SHARED = -2


@kernel
def gather(  # type: ignore[no-untyped-def]
    planes, children, corners, numbers, root, matrix, low, high, size, tags, owner, stack,
    brought, used, triangles, parts,
):  # fmt: skip
    """Bring the triangles of a hierarchy that may be in the grid there, behind those before.

    Args:
        planes, children, corners, numbers: as of :class:`carstage_sim.render.cast.Geometry`.
        root: its node.
        matrix: ``(3, 4)`` float64 from the hierarchy's frame to voxels.
        low, high: ``(3,)`` of a box that holds the grid, in the hierarchy's frame.
        size: ``(3,)`` voxels along each axis.
        tags: ``(T,)`` of triangles by their numbers.
        owner: whose they are.
        stack: ``(512,)`` int32.
        brought: ``(9, 8)`` float64.
        used: how many are there.
        triangles: ``(N, 9)`` float32, filled up to its end.
        parts: ``(N,)`` int32, likewise.

    Returns:
        How many there are then; more than fit if some were not kept.
    """
    depth = 1
    stack[0] = root
    while depth > 0:
        depth -= 1
        node = stack[depth]
        for lane in range(LANES):
            apart = False
            for axis in range(3):
                apart |= planes[node, axis, lane] > high[axis]
                apart |= planes[node, axis + 3, lane] < low[axis]
            if apart:
                continue
            child = children[node, lane]
            if child >= 0:
                stack[depth] = child
                depth += 1
                continue
            block = -1 - child
            _bring(corners[block], matrix, brought)
            for place in range(LANES):
                number = numbers[block, place]
                if number >= 0 and _is_near(brought, place, size):
                    row = min(used, len(parts) - 1)
                    for k in range(9):
                        triangles[row, k] = brought[k, place]
                    parts[row] = owner * TAGS + tags[number]
                    used += 1
    return used


@device
def _bring(corners, matrix, brought):  # type: ignore[no-untyped-def]
    """Bring the corners of a block's triangles into the grid's frame, all lanes at once."""
    for axis in range(3):
        a, b, c, d = matrix[axis, 0], matrix[axis, 1], matrix[axis, 2], matrix[axis, 3]
        for corner in range(0, 9, 3):
            for lane in range(LANES):
                brought[corner + axis, lane] = (
                    a * corners[corner, lane]
                    + b * corners[corner + 1, lane]
                    + c * corners[corner + 2, lane]
                    + d
                )


@device
def _is_near(brought, lane, size):  # type: ignore[no-untyped-def]
    """Whether a triangle's box meets the grid."""
    for axis in range(3):
        one, two, three = brought[axis, lane], brought[3 + axis, lane], brought[6 + axis, lane]
        if max(one, two, three) < 0.0 or min(one, two, three) >= size[axis]:
            return False
    return True


@kernel
def mark(triangles, parts, count, first, visits, scratch):  # type: ignore[no-untyped-def]
    """Note which part is in each voxel, and which triangles are.

    Args:
        triangles, parts: of :func:`gather`.
        count: how many there are.
        first: ``(X, Y, Z)`` int32, ``EMPTY`` before; the part of each voxel that has one, and for
            the n-th of those that have several ``-2 - n``.
        visits: ``(V, 2)`` int32, set: a voxel's flat number, and a triangle that is in it.
        scratch: ``(5, 30)`` float64.

    Returns:
        How many voxels have a part, how many have several, and how many visits there are; more
        than fit if some were not kept.
    """
    used = 0
    for n in range(count):
        used = _visit(triangles[n], n, first, visits, used, scratch)
    taken, shared = 0, 0
    flat = first.reshape(-1)
    for n in range(min(used, len(visits))):
        voxel, part = visits[n, 0], parts[visits[n, 1]]
        found = flat[voxel]
        if found == EMPTY:
            flat[voxel] = part
            taken += 1
        elif found >= 0 and found != part:
            flat[voxel] = _SHARED - shared
            shared += 1
    return taken, shared, used


@kernel
def measure(triangles, parts, visits, used, first, heads, links, areas, scratch):  # type: ignore[no-untyped-def]
    """Add up the surface of each part in the voxels that have several.

    Args:
        triangles, parts, visits, first, scratch: of :func:`mark`.
        used: how many visits there are.
        heads: ``(S,)`` int32, -1 before; the first entry of each of those voxels.
        links: ``(E, 2)`` int32: an entry's part, and the voxel's next entry.
        areas: ``(E,)`` float64, in squares of a voxel's side.

    Returns:
        How many entries there are; more than fit if some were not kept.
    """
    entries = 0
    flat = first.reshape(-1)
    for n in range(used):
        voxel, triangle = visits[n, 0], visits[n, 1]
        if flat[voxel] > _SHARED:
            continue
        place, part = _SHARED - flat[voxel], parts[triangle]
        entry = heads[place]
        while entry >= 0 and links[entry, 0] != part:
            entry = links[entry, 1]
        if entry < 0:
            entry = entries
            entries += 1
            if entry >= len(areas):
                continue
            links[entry, 0], links[entry, 1] = part, heads[place]
            areas[entry] = 0.0
            heads[place] = entry
        column = voxel // first.shape[2]
        x, y, z = column // first.shape[1], column % first.shape[1], voxel % first.shape[2]
        areas[entry] += _area(triangles[triangle], x, y, z, scratch)
    return entries


@device
def _visit(t, number, first, visits, used, scratch):  # type: ignore[no-untyped-def]
    """Note all voxels that a triangle is in; how many visits there are then."""
    low_x, high_x = _span(t, 0)
    low_y, high_y = _span(t, 1)
    low_z, high_z = _span(t, 2)
    single = (low_x == high_x) + (low_y == high_y) + (low_z == high_z)
    if single == 3 and t[0] == t[3] and t[0] == t[6] and t[1] == t[4] and t[1] == t[7]:
        return used  # hidden triangles are points
    if single == 0:
        return _scan(t, number, first, visits, used, scratch)
    if single == 1:
        w = 0 if low_x == high_x else 1 if low_y == high_y else 2
        return _fill(t, w, number, first, visits, used, scratch)
    # It stays within a row of voxels, so it is in each from its one end to the other.
    for x in range(max(low_x, 0), min(high_x, first.shape[0] - 1) + 1):
        for y in range(max(low_y, 0), min(high_y, first.shape[1] - 1) + 1):
            for z in range(max(low_z, 0), min(high_z, first.shape[2] - 1) + 1):
                used = _keep(first, x, y, z, number, visits, used)
    return used


@device
def _keep(first, x, y, z, number, visits, used):  # type: ignore[no-untyped-def]
    """Keep one visit, where there is room."""
    if used < len(visits):
        visits[used, 0] = (x * first.shape[1] + y) * first.shape[2] + z
        visits[used, 1] = number
    return used + 1


@device
def _span(t, axis):  # type: ignore[no-untyped-def]
    """First and last voxel along an axis; what is at a lower face is in the voxel above it."""
    least = min(min(t[axis], t[3 + axis]), t[6 + axis])
    most = max(max(t[axis], t[3 + axis]), t[6 + axis])
    return int(np.floor(least)), int(np.floor(most))


@device
def _normal(t):  # type: ignore[no-untyped-def]
    """The triangle's normal, of twice its area's length."""
    ax, ay, az = np.float64(t[3]) - t[0], np.float64(t[4]) - t[1], np.float64(t[5]) - t[2]
    bx, by, bz = np.float64(t[6]) - t[0], np.float64(t[7]) - t[1], np.float64(t[8]) - t[2]
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@device
def _scan(t, number, first, visits, used, scratch):  # type: ignore[no-untyped-def]
    """As :func:`_visit`, of a triangle that is in more than a row of voxels.

    Rows run along the axis ``v`` of its steepest projection, columns along ``w``.
    """
    normal = _normal(t)
    if normal[0] == 0.0 and normal[1] == 0.0 and normal[2] == 0.0:
        return used
    u, v, w = _axes(normal)
    edges = scratch[:3]
    for k in range(3):
        a, b, c = (v, w, u) if k == 1 else (w, u, v) if k == 2 else (u, v, w)
        _edges(t, a, b, normal[c], edges[k])
    slope_u, slope_v = -normal[u] / normal[w], -normal[v] / normal[w]
    height = t[w] - slope_u * t[u] - slope_v * t[v] + min(slope_u, 0.0) + min(slope_v, 0.0)
    rise = abs(slope_u) + abs(slope_v)
    first_u, last_u = _span(t, u)
    first_w, last_w = _span(t, w)
    first_w, last_w = max(first_w, 0), min(last_w, first.shape[w] - 1)
    for i in range(max(first_u, 0), min(last_u, first.shape[u] - 1) + 1):
        first_v, last_v = _row(t, v, i, edges[0], first.shape[v])
        for j in range(first_v, last_v + 1):
            base = height + slope_u * i + slope_v * j
            lowest = max(int(np.floor(base)), first_w)
            for k in range(lowest, min(int(np.floor(base + rise)), last_w) + 1):
                if _inside(edges[1], j, k) and _inside(edges[2], k, i):
                    x, y, z = (i, j, k) if w == 2 else (k, i, j) if w == 0 else (j, k, i)
                    used = _keep(first, x, y, z, number, visits, used)
    return used


@device
def _fill(t, w, number, first, visits, used, scratch):  # type: ignore[no-untyped-def]
    """As :func:`_visit`, of a triangle that stays within a layer of voxels across axis ``w``.

    It is in those that its projection along that axis is in.
    """
    u, v = (w + 1) % 3, (w + 2) % 3
    normal, edges = _normal(t), scratch[0]
    k = _span(t, w)[0]
    if k < 0 or k >= first.shape[w]:
        return used
    _edges(t, u, v, normal[w], edges)
    first_u, last_u = _span(t, u)
    for i in range(max(first_u, 0), min(last_u, first.shape[u] - 1) + 1):
        first_v, last_v = _row(t, v, i, edges, first.shape[v])
        for j in range(first_v, last_v + 1):
            x, y, z = (i, j, k) if w == 2 else (k, i, j) if w == 0 else (j, k, i)
            used = _keep(first, x, y, z, number, visits, used)
    return used


@device
def _axes(normal):  # type: ignore[no-untyped-def]
    """The axes of the projection in which a triangle is largest, and the third one."""
    x, y, z = abs(normal[0]), abs(normal[1]), abs(normal[2])
    if z >= x and z >= y:
        return 0, 1, 2
    return (1, 2, 0) if x >= y else (2, 0, 1)


@device
def _edges(t, u, v, turn, edges):  # type: ignore[no-untyped-def]
    """Edges of a projection: a square at (i, j) is not beyond one if ``a i + b j + c >= 0``.

    Args:
        t: the triangle.
        u, v: axes of the projection.
        turn: the normal along the third; its sign says how the corners go round.
        edges: ``(9,)``, set: a, b and c of each edge.
    """
    sign = 1.0 if turn >= 0.0 else -1.0
    for n in range(3):
        here, there = 3 * n, 3 * ((n + 1) % 3)
        a = -sign * (np.float64(t[there + v]) - t[here + v])
        b = sign * (np.float64(t[there + u]) - t[here + u])
        edges[3 * n], edges[3 * n + 1] = a, b
        edges[3 * n + 2] = max(a, 0.0) + max(b, 0.0) - a * t[here + u] - b * t[here + v]


@device
def _inside(edges, i, j):  # type: ignore[no-untyped-def]
    """Whether a square is beyond none of a projection's edges."""
    return (
        edges[0] * i + edges[1] * j + edges[2] >= 0.0
        and edges[3] * i + edges[4] * j + edges[5] >= 0.0
        and edges[6] * i + edges[7] * j + edges[8] >= 0.0
    )


@device
def _row(t, v, i, edges, size):  # type: ignore[no-untyped-def]
    """First and last of a row's squares that the projected triangle is in."""
    low, high = _span(t, v)
    low, high = max(low, 0), min(high, size - 1)
    for n in range(0, 9, 3):
        reach = edges[n] * i + edges[n + 2]
        along = edges[n + 1]
        if along > 0.0:
            low = max(low, int(np.ceil(min(max(-reach / along, -1.0), np.float64(size)))))
        elif along < 0.0:
            high = min(high, int(np.floor(max(min(reach / -along, np.float64(size)), -1.0))))
        elif reach < 0.0:
            return 0, -1
    return low, high


@device
def _area(t, x, y, z, scratch):  # type: ignore[no-untyped-def]
    """A triangle's area in a voxel: cut at its six faces, after Sutherland and Hodgman (1974)."""
    near, far = scratch[3], scratch[4]
    for n in range(0, 9, 3):
        near[n], near[n + 1], near[n + 2] = t[n] - x, t[n + 1] - y, t[n + 2] - z
    count = 3
    for face in range(6):
        axis, upper = face % 3, face >= 3
        if _leaves(near, count, axis, upper):
            count = _cut(near, count, axis, upper, far)
            near, far = far, near
    sx, sy, sz = 0.0, 0.0, 0.0
    for n in range(3, 3 * count - 3, 3):
        ax, ay, az = near[n] - near[0], near[n + 1] - near[1], near[n + 2] - near[2]
        bx, by, bz = near[n + 3] - near[0], near[n + 4] - near[1], near[n + 5] - near[2]
        sx += ay * bz - az * by
        sy += az * bx - ax * bz
        sz += ax * by - ay * bx
    return 0.5 * np.sqrt(sx * sx + sy * sy + sz * sz)


@device
def _leaves(polygon, count, axis, upper):  # type: ignore[no-untyped-def]
    """Whether a polygon goes below 0 along an axis, or above 1."""
    leaves = False
    for n in range(axis, 3 * count, 3):
        leaves |= polygon[n] > 1.0 if upper else polygon[n] < 0.0
    return leaves


@device
def _cut(polygon, count, axis, upper, kept):  # type: ignore[no-untyped-def]
    """Keep what of a polygon is above 0 along an axis, or below 1; its corners' number then."""
    left = 0
    for n in range(count):
        here, there = 3 * n, 3 * ((n + 1) % count)
        inside = 1.0 - polygon[here + axis] if upper else polygon[here + axis]
        beyond = 1.0 - polygon[there + axis] if upper else polygon[there + axis]
        if inside >= 0.0:
            for k in range(3):
                kept[3 * left + k] = polygon[here + k]
            left += 1
        if (inside >= 0.0) != (beyond >= 0.0):
            share = inside / (inside - beyond)
            for k in range(3):
                step = polygon[there + k] - polygon[here + k]
                kept[3 * left + k] = polygon[here + k] + share * step
            left += 1
    return left


@kernel
def collect(first, heads, links, areas, low_m, side_m, ids, places, codes):  # type: ignore[no-untyped-def]
    """What is in each voxel: a row for each owner, the one with most surface first.

    An owner's tag is that of most of its surface in the voxel. Of equal ones, lower numbers go
    first.

    Args:
        first, heads, links, areas: of :func:`mark` and :func:`measure`; ``areas`` is used up.
        low_m: ``(3,)`` of the grid's lower corner: forward, left, up.
        side_m: of a voxel.
        ids: ``(I + 1,)`` uint32 of the owners.
        places, codes: ``(N, 6)`` float32 and uint32, the same memory, set: rows of
            ``SEMANTIC_POINT`` in the order of the voxels.

    Returns:
        How many rows there are.
    """
    rows = 0
    for x in range(first.shape[0]):
        for y in range(first.shape[1]):
            for z in range(first.shape[2]):
                part = first[x, y, z]
                entry = heads[_SHARED - part] if part <= _SHARED else -1
                while part != EMPTY:
                    owner, tag = part // TAGS, part % TAGS
                    if part <= _SHARED:
                        owner, tag = _take_most(entry, links, areas)
                        if owner < 0:
                            break
                    places[rows, 0] = (x + 0.5) * side_m + low_m[0]
                    places[rows, 1] = -((y + 0.5) * side_m + low_m[1])
                    places[rows, 2] = (z + 0.5) * side_m + low_m[2]
                    codes[rows, 4], codes[rows, 5] = ids[owner], tag
                    rows += 1
                    if part >= 0:
                        break
    return rows


@device
def _take_most(head, links, areas):  # type: ignore[no-untyped-def]
    """The owner with most surface of a list of entries, and its tag; its entries are used up."""
    best, best_area = -1, -1.0
    one = head
    while one >= 0:
        if areas[one] >= 0.0:
            owner, total = links[one, 0] // TAGS, 0.0
            other = head
            while other >= 0:
                if areas[other] >= 0.0 and links[other, 0] // TAGS == owner:
                    total += areas[other]
                other = links[other, 1]
            if total > best_area or (total == best_area and owner < best):
                best, best_area = owner, total
        one = links[one, 1]
    found, most = 0, -1.0
    one = head
    while one >= 0:
        if areas[one] >= 0.0 and links[one, 0] // TAGS == best:
            tag = links[one, 0] % TAGS
            if areas[one] > most or (areas[one] == most and tag < found):
                found, most = tag, areas[one]
            areas[one] = -1.0
        one = links[one, 1]
    return best, found
