"""Eight-wide box and triangle tests, written as LLVM vector code.

numba has no vector types, and LLVM does not find these loops by itself. A wide node holds eight
child boxes and a leaf block eight triangles, each coordinate as eight consecutive float32; one call
tests all eight. LLVM splits the vectors on CPUs with narrower registers, with the same result:
no operation is contracted or reordered, so all machines agree to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

from carstage_sim.kernels import Decorator

LANES = 8
"""Children of a node and triangles of a leaf block."""
PACKET = 64
"""Rays that are traced together."""
_BEAM_SLACK = 3e-6
"""Share of a box's largest coordinates that allows for rounding: normals of a beam's sides have
components below 2.8."""
_EDGES = ((0, 1), (1, 2), (2, 0))
_EDGE_SLACK = 1e-5
"""Share of two corners' distances, multiplied, that allows for the rounding of an edge's side."""

_intrinsic: Decorator = intrinsic
_array_struct: Any = make_array
_new_variable: Any = cgutils.alloca_once_value

_F32 = ir.FloatType()
_I32 = ir.IntType(32)
_I64 = ir.IntType(64)
_VEC = ir.VectorType(_F32, LANES)


def _splat(builder: Any, scalar: Any) -> Any:
    zero = ir.Constant(_VEC, None)
    first = builder.insert_element(zero, scalar, ir.Constant(_I32, 0))
    mask = ir.Constant(ir.VectorType(_I32, LANES), [0] * LANES)
    return builder.shuffle_vector(first, zero, mask)


def _constant(value: float) -> Any:
    return ir.Constant(_VEC, [ir.Constant(_F32, value)] * LANES)


def _lane_pointer(builder: Any, data: Any, row: Any) -> Any:
    """Address of the eight floats number ``row`` of a flat float32 array."""
    offset = builder.mul(row, ir.Constant(_I64, LANES))
    return builder.bitcast(builder.gep(data, [offset]), _VEC.as_pointer())


def _load(builder: Any, data: Any, row: Any) -> Any:
    return builder.load(_lane_pointer(builder, data, row), align=4)


def _store(builder: Any, value: Any, data: Any, row: Any) -> None:
    place = ir.Constant(_I64, row) if isinstance(row, int) else row
    builder.store(value, _lane_pointer(builder, data, place), align=4)


def _larger(builder: Any, a: Any, b: Any) -> Any:
    return builder.select(builder.fcmp_ordered(">", a, b), a, b)


def _smaller(builder: Any, a: Any, b: Any) -> Any:
    return builder.select(builder.fcmp_ordered("<", a, b), a, b)


def _bits(builder: Any, lanes: Any) -> Any:
    """Eight booleans as the low eight bits of an int64."""
    return builder.zext(builder.bitcast(lanes, ir.IntType(LANES)), _I64)


def _unpack(context: Any, builder: Any, signature: Any, args: Any) -> list[Any]:
    """Arguments with arrays replaced by their data pointers, float scalars as float32."""
    values = []
    for kind, value in zip(signature.args, args, strict=True):
        if isinstance(kind, types.Array):
            values.append(_array_struct(kind)(context, builder, value).data)
        elif isinstance(kind, types.Float):
            values.append(context.cast(builder, value, kind, types.float32))
        else:
            values.append(context.cast(builder, value, kind, types.int64))
    return values


def _meet(
    builder: Any, xs: Any, ys: Any, zs: Any, low: Any, high: Any, found: Any, places: Any
) -> Any:
    """Where eight rays meet eight triangles whose corners are sheared along the rays.

    Stores parameters and weights in rows ``places`` of ``found``; the bits say which do. Most often
    no ray is within its triangle's edges: then nothing is stored.
    """

    def edge(a: int, b: int) -> Any:
        return builder.fsub(builder.fmul(xs[a], ys[b]), builder.fmul(ys[a], xs[b]))

    u, v, w = edge(2, 1), edge(0, 2), edge(1, 0)
    zero = _constant(0.0)
    least = _smaller(builder, _smaller(builder, u, v), w)
    most = _larger(builder, _larger(builder, u, v), w)
    inside = builder.or_(
        builder.fcmp_ordered(">=", least, zero), builder.fcmp_ordered("<=", most, zero)
    )
    nothing = ir.Constant(_I64, 0)
    met = _new_variable(builder, nothing)
    with builder.if_then(builder.icmp_unsigned("!=", _bits(builder, inside), nothing)):
        determinant = builder.fadd(builder.fadd(u, v), w)
        scaled = builder.fadd(
            builder.fadd(builder.fmul(u, zs[0]), builder.fmul(v, zs[1])), builder.fmul(w, zs[2])
        )
        inverse = builder.fdiv(_constant(1.0), determinant)
        t = builder.fmul(scaled, inverse)
        within = builder.and_(
            builder.fcmp_ordered(">=", t, low), builder.fcmp_ordered("<=", t, high)
        )
        solid = builder.fcmp_ordered("!=", determinant, zero)
        for value, place in zip(
            (t, builder.fmul(u, inverse), builder.fmul(v, inverse)), places, strict=True
        ):
            _store(builder, value, found, place)
        bits = _bits(builder, builder.and_(builder.and_(inside, within), solid))
        builder.store(bits, met)
    return builder.load(met)


def _in_rows(builder: Any, rows: Any, meet_row: Callable[[Any], Any]) -> Any:
    """``meet_row`` of each row of eight rays whose bit is set; their bits one behind the other."""
    nothing, one = ir.Constant(_I64, 0), ir.Constant(_I64, 1)
    left, met = _new_variable(builder, rows), _new_variable(builder, nothing)
    check, body, end = (builder.append_basic_block(name) for name in ("check", "row", "rows_end"))
    builder.branch(check)
    builder.position_at_end(check)
    value = builder.load(left)
    builder.cbranch(builder.icmp_unsigned("!=", value, nothing), body, end)
    builder.position_at_end(body)
    row = builder.cttz(value, cgutils.true_bit)
    builder.store(builder.and_(value, builder.sub(value, one)), left)
    bits = builder.shl(meet_row(row), builder.mul(row, ir.Constant(_I64, LANES)))
    builder.store(builder.or_(builder.load(met), bits), met)
    builder.branch(check)
    builder.position_at_end(end)
    return builder.load(met)


def _rows_of_found(builder: Any, row: Any) -> list[Any]:
    """Where parameters and weights of eight of 64 rays belong."""
    return [builder.add(row, ir.Constant(_I64, k * PACKET // LANES)) for k in range(3)]


@_intrinsic
def box_hits(  # type: ignore[no-untyped-def]
    typing_context, planes, node, near_x, near_y, near_z, ox, oy, oz, ix, iy, iz, low, high, entry
):
    """Which of a node's eight boxes a ray enters between ``low`` and ``high``.

    Args:
        typing_context: numba's.
        planes: ``(N, 6, 8)`` float32: lowest x, y, z, then highest x, y, z of eight boxes.
        node: row of ``planes``.
        near_x, near_y, near_z: 0 where the ray runs upwards along the axis, 3 where downwards.
        ox, oy, oz: ray origin.
        ix, iy, iz: reciprocal of the ray direction, finite.
        low, high: interval of the ray parameter.
        entry: ``(>= 8,)`` float32, receives the parameter at which each box is entered.

    Returns:
        int64 whose bit ``k`` says that box ``k`` is met. Rounding is met by growing each interval
        by one part in a million, so that no triangle of a box is lost.
    """
    signature = types.int64(
        planes, node, near_x, near_y, near_z, ox, oy, oz, ix, iy, iz, low, high, entry
    )

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        values = _unpack(context, builder, signature, args)
        data, row, nears = values[0], values[1], values[2:5]
        origin = [_splat(builder, v) for v in values[5:8]]
        inverse = [_splat(builder, v) for v in values[8:11]]
        enter, leave = _splat(builder, values[11]), _splat(builder, values[12])
        first = builder.mul(row, ir.Constant(_I64, 6))
        enters: list[Any] = []
        leaves: list[Any] = []
        for axis in range(3):
            near_row = builder.add(first, builder.add(nears[axis], ir.Constant(_I64, axis)))
            far_row = builder.add(first, builder.sub(ir.Constant(_I64, axis + 3), nears[axis]))
            for found, plane in ((enters, near_row), (leaves, far_row)):
                distance = builder.fsub(_load(builder, data, plane), origin[axis])
                found.append(builder.fmul(distance, inverse[axis]))
        grown_enter = _constant(1.0 - 1e-6)
        grown_leave = _constant(1.0 + 1e-6)
        nearest = _larger(builder, _larger(builder, enters[0], enters[1]), enters[2])
        farthest = _smaller(builder, _smaller(builder, leaves[0], leaves[1]), leaves[2])
        nearest = _larger(builder, builder.fmul(nearest, grown_enter), enter)
        farthest = _smaller(builder, builder.fmul(farthest, grown_leave), leave)
        _store(builder, nearest, values[13], 0)
        return _bits(builder, builder.fcmp_ordered("<=", nearest, farthest))

    return signature, codegen


@_intrinsic
def triangle_hits(  # type: ignore[no-untyped-def]
    typing_context, corners, block, kx, ky, kz, ox, oy, oz, sx, sy, sz, low, high, found
):
    """Which of a block's eight triangles a ray meets between ``low`` and ``high``, both sides.

    The watertight test of Woop, Benthin and Wald (JCGT 2013) without its double precision step:
    an edge function of exactly zero counts as inside, so an edge shared by two triangles is never
    missed by both.

    Args:
        typing_context: numba's.
        corners: ``(N, 9, 8)`` float32: x, y, z of the first, second and third corner.
        block: row of ``corners``.
        kx, ky, kz: axes in the order that puts the direction's largest component last.
        ox, oy, oz: ray origin along those axes.
        sx, sy, sz: the shear ``d[kx] / d[kz]``, ``d[ky] / d[kz]`` and ``1 / d[kz]``.
        low, high: interval of the ray parameter, both ends included.
        found: ``(>= 24,)`` float32, receives the parameter and the weights of the first and
            second corner, eight of each; valid where the bit is set.

    Returns:
        int64 whose bit ``k`` says that triangle ``k`` is met.
    """
    signature = types.int64(corners, block, kx, ky, kz, ox, oy, oz, sx, sy, sz, low, high, found)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        values = _unpack(context, builder, signature, args)
        data, row, axes = values[0], values[1], values[2:5]
        origin = [_splat(builder, v) for v in values[5:8]]
        shear_x, shear_y, shear_z = (_splat(builder, v) for v in values[8:11])
        first = builder.mul(row, ir.Constant(_I64, 9))
        xs, ys, zs = [], [], []
        for corner in range(3):
            base = builder.add(first, ir.Constant(_I64, 3 * corner))
            x, y, z = (
                builder.fsub(_load(builder, data, builder.add(base, axis)), start)
                for axis, start in zip(axes, origin, strict=True)
            )
            xs.append(builder.fsub(x, builder.fmul(shear_x, z)))
            ys.append(builder.fsub(y, builder.fmul(shear_y, z)))
            zs.append(builder.fmul(shear_z, z))
        low, high = (_splat(builder, v) for v in values[11:13])
        return _meet(builder, xs, ys, zs, low, high, values[13], range(3))

    return signature, codegen


@_intrinsic
def lowest_bit(typing_context, bits):  # type: ignore[no-untyped-def]
    """Number of the lowest set bit of a non-zero int64."""

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        return builder.cttz(args[0], cgutils.true_bit)

    return types.int64(types.int64), codegen


def _magnitude(builder: Any, value: Any) -> Any:
    kind = ir.VectorType(_I32, LANES)
    mask = ir.Constant(kind, [0x7FFFFFFF] * LANES)
    return builder.bitcast(builder.and_(builder.bitcast(value, kind), mask), _VEC)


def _dot(builder: Any, vector: Any, point: Any) -> Any:
    """Product of a direction, eight times the same, and eight points."""
    x, y, z = (builder.fmul(a, b) for a, b in zip(vector, point, strict=True))
    return builder.fadd(builder.fadd(x, y), z)


def _reach(builder: Any, low: list[Any], high: list[Any]) -> Any:
    """Sum of the largest coordinates of eight boxes' corners."""
    total = None
    for one, other in zip(low, high, strict=True):
        part = _larger(builder, _magnitude(builder, one), _magnitude(builder, other))
        total = part if total is None else builder.fadd(total, part)
    return total


def _span(builder: Any, normal: list[Any], low: list[Any], high: list[Any]) -> tuple[Any, Any]:
    """Least and largest place of eight boxes along a direction."""
    least, most = None, None
    for factor, one, other in zip(normal, low, high, strict=True):
        a, b = builder.fmul(factor, one), builder.fmul(factor, other)
        lower, upper = _smaller(builder, a, b), _larger(builder, a, b)
        least = lower if least is None else builder.fadd(least, lower)
        most = upper if most is None else builder.fadd(most, upper)
    return least, most


def _corner(builder: Any, data: Any, first: Any, axis: Any, corner: int) -> Any:
    """A coordinate of a triangle's corner; ``first`` is where the triangle's lane begins."""
    row = builder.add(axis, ir.Constant(_I64, 3 * corner))
    place = builder.add(first, builder.mul(row, ir.Constant(_I64, LANES)))
    return builder.load(builder.gep(data, [place]))


@_intrinsic
def boxes_in_beam(typing_context, planes, node, beam, farthest, entry):  # type: ignore[no-untyped-def]
    """Which of a node's eight boxes a beam of rays may meet.

    Args:
        typing_context: numba's.
        planes: as for :func:`box_hits`.
        node: row of ``planes``.
        beam: ``(>= 19,)`` float32: the rays' common origin, the normals of the four sides that
            enclose them, their middle direction, and the reciprocal of the largest component
            along it that a ray's direction has.
        farthest: ray parameter beyond which no hit is wanted.
        entry: ``(>= 8,)`` float32, receives a parameter before which no ray enters each box.

    Returns:
        int64 whose bit ``k`` says that box ``k`` may be met, with room for rounding.
    """
    signature = types.int64(planes, node, beam, farthest, entry)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, row, sides, far, out = _unpack(context, builder, signature, args)

        def number(place: int) -> Any:
            index = ir.Constant(_I64, place)
            return builder.load(builder.gep(sides, [index]))

        first = builder.mul(row, ir.Constant(_I64, 6))
        origin = [_splat(builder, number(axis)) for axis in range(3)]
        lowest, highest = (
            [
                builder.fsub(
                    _load(builder, data, builder.add(first, ir.Constant(_I64, axis + begin))),
                    origin[axis],
                )
                for axis in range(3)
            ]
            for begin in (0, 3)
        )
        slack = builder.fmul(_reach(builder, lowest, highest), _constant(_BEAM_SLACK))
        least_off = builder.fsub(_constant(0.0), slack)
        met = builder.fcmp_ordered("<=", lowest[0], highest[0])
        for side in range(5):
            normal = [_splat(builder, number(3 + 3 * side + axis)) for axis in range(3)]
            least, most = _span(builder, normal, lowest, highest)
            met = builder.and_(met, builder.fcmp_ordered(">=", most, least_off))
        enters = builder.fmul(builder.fsub(least, slack), _splat(builder, number(18)))
        enters = _larger(builder, enters, _constant(0.0))
        met = builder.and_(met, builder.fcmp_ordered("<=", enters, _splat(builder, far)))
        _store(builder, enters, out, 0)
        return _bits(builder, met)

    return signature, codegen


def _straddled(builder: Any, points: list[Any], sizes: list[Any], bounds: list[Any]) -> Any:
    """Whether no edge of eight triangles keeps all of a beam on its outer side.

    Args:
        builder: LLVM's.
        points: the three corners, seen from the beam's origin: across it and ahead.
        sizes: how far they are, about.
        bounds: least and largest slopes of the beam's rays.
    """
    edges: list[tuple[Any, Any, Any]] = []
    for one, other in _EDGES:
        (ax, ay, az), (bx, by, bz) = points[one], points[other]
        normal = [_minor(builder, ay, bz, az, by), _minor(builder, az, bx, ax, bz)]
        slack = builder.fmul(builder.fmul(sizes[one], sizes[other]), _constant(_EDGE_SLACK))
        edges.append((normal, _minor(builder, ax, by, ay, bx), slack))
    return _reaches_inside(builder, edges, bounds)


def _straddled_along(builder: Any, points: list[Any], sizes: list[Any], bounds: list[Any]) -> Any:
    """As :func:`_straddled`, of parallel rays.

    Args:
        builder: LLVM's.
        points: the three corners: across the rays.
        sizes: how far they are from the rays' origins at most.
        bounds: least and largest places of the rays.
    """
    edges: list[tuple[Any, Any, Any]] = []
    for one, other in _EDGES:
        (ax, ay), (bx, by) = points[one], points[other]
        normal = [builder.fsub(ay, by), builder.fsub(bx, ax)]
        slack = builder.fmul(builder.fmul(sizes[one], sizes[other]), _constant(_EDGE_SLACK))
        edges.append((normal, _minor(builder, ax, by, ay, bx), slack))
    return _reaches_inside(builder, edges, bounds)


def _minor(builder: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    return builder.fsub(builder.fmul(a, b), builder.fmul(c, d))


def _reaches_inside(builder: Any, edges: list[Any], bounds: list[Any]) -> Any:
    """Whether some place within bounds may be on the same side of all three edges.

    Each edge: factors of the place's two coordinates, what is added, room for rounding.
    """
    leftmost, rightmost = None, None
    for normal, offset, slack in edges:
        least, most = _span(builder, normal, [bounds[0], bounds[2]], [bounds[1], bounds[3]])
        most = builder.fadd(builder.fadd(most, offset), slack)
        least = builder.fsub(builder.fadd(least, offset), slack)
        leftmost = most if leftmost is None else _smaller(builder, leftmost, most)
        rightmost = least if rightmost is None else _larger(builder, rightmost, least)
    zero = _constant(0.0)
    return builder.or_(
        builder.fcmp_unordered(">=", leftmost, zero), builder.fcmp_unordered("<=", rightmost, zero)
    )


@_intrinsic
def triangles_in_beam(typing_context, corners, block, axes, beam, farthest, places):  # type: ignore[no-untyped-def]
    """Which of a block's eight triangles a beam of rays may meet, and in which rows of its rays.

    Args:
        typing_context: numba's.
        corners: as for :func:`triangle_hits`.
        block: row of ``corners``.
        axes: ``(>= 13,)`` float32: two directions across the beam, its middle direction, and the
            least and largest slopes of its rays along the two.
        beam: as for :func:`boxes_in_beam`.
        farthest: ray parameter beyond which no hit is wanted.
        places: ``(>= 24,)`` float32, receives the least and largest slope of each triangle along
            the second direction, and a parameter before which no ray meets it.

    Returns:
        int64 whose bit ``k`` says that triangle ``k`` may be met.
    """
    signature = types.int64(corners, block, axes, beam, farthest, places)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, row, across, sides, far, out = _unpack(context, builder, signature, args)

        def number(array: Any, place: int) -> Any:
            return _splat(builder, builder.load(builder.gep(array, [ir.Constant(_I64, place)])))

        origin = [number(sides, axis) for axis in range(3)]
        vectors = [[number(across, 3 * k + axis) for axis in range(3)] for k in range(3)]
        bounds = [number(across, 9 + k) for k in range(4)]
        first = builder.mul(row, ir.Constant(_I64, 9))
        least: list[Any] = [None] * 3
        most: list[Any] = [None] * 3
        slack, nearest = None, None
        points: list[Any] = []
        sizes: list[Any] = []
        one, tiny = _constant(1.0), _constant(1e-6)
        for corner in range(3):
            point = [
                builder.fsub(
                    _load(builder, data, builder.add(first, ir.Constant(_I64, 3 * corner + axis))),
                    origin[axis],
                )
                for axis in range(3)
            ]
            right, up, ahead = (_dot(builder, vector, point) for vector in vectors)
            size = builder.fadd(
                builder.fadd(_magnitude(builder, point[0]), _magnitude(builder, point[1])),
                _magnitude(builder, point[2]),
            )
            points.append((right, up, ahead))
            sizes.append(size)
            inverse = builder.fdiv(one, ahead)
            size = builder.fmul(size, tiny)
            off = builder.fmul(size, inverse)
            slack = off if slack is None else _larger(builder, slack, off)
            certain = builder.fsub(ahead, size)
            nearest = certain if nearest is None else _smaller(builder, nearest, certain)
            for k, value in enumerate(
                (builder.fmul(right, inverse), builder.fmul(up, inverse), ahead)
            ):
                held, top = least[k], most[k]
                least[k] = value if held is None else _smaller(builder, held, value)
                most[k] = value if top is None else _larger(builder, top, value)
        slack = builder.fadd(slack, tiny)
        within = None
        for k in range(2):
            low, high = builder.fsub(least[k], slack), builder.fadd(most[k], slack)
            if k == 1:
                rows = (low, high)
            overlap = builder.and_(
                builder.fcmp_ordered("<=", low, bounds[2 * k + 1]),
                builder.fcmp_ordered(">=", high, bounds[2 * k]),
            )
            within = overlap if within is None else builder.and_(within, overlap)
        # What reaches behind the origin has no such place: it is taken for everywhere.
        front = builder.fcmp_ordered(">", least[2], _constant(1e-3))
        somewhere = builder.fcmp_ordered(">=", most[2], _constant(0.0))
        reach = builder.fmul(nearest, number(sides, 18))
        near = builder.fcmp_ordered("<=", reach, _splat(builder, far))
        huge = 3.0e38
        for k, (value, otherwise) in enumerate(((rows[0], -huge), (rows[1], huge), (reach, -huge))):
            _store(builder, builder.select(front, value, _constant(otherwise)), out, k)
        met = builder.select(front, builder.and_(within, near), somewhere)
        return _bits(builder, builder.and_(met, _straddled(builder, points, sizes, bounds)))

    return signature, codegen


@_intrinsic
def rays_hit(  # type: ignore[no-untyped-def]
    typing_context, corners, block, lane, kx, ky, kz, beam, rays, rows, low, found
):
    """Which of 64 rays of one origin meet a triangle, at most as far as they have come.

    The operations are those of :func:`triangle_hits`, in the same order: the results are equal.

    Args:
        typing_context: numba's.
        corners, block: as for :func:`triangle_hits`.
        lane: the triangle.
        kx, ky, kz: axes in the order that puts the directions' largest component last.
        beam: as for :func:`boxes_in_beam`.
        rays: ``(4, PACKET)`` float32 for each ray: its shear, and the largest parameter that
            counts.
        rows: a bit for each eight of the rays that are asked.
        low: smallest parameter that counts.
        found: ``(3, PACKET)`` float32, receives what :func:`triangle_hits` finds, of each ray.

    Returns:
        int64 whose bit ``k`` says that ray ``k`` meets the triangle.
    """
    signature = types.int64(corners, block, lane, kx, ky, kz, beam, rays, rows, low, found)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, number, place, *axes, sides, lanes, which, least, out = _unpack(
            context, builder, signature, args
        )
        first = builder.mul(number, ir.Constant(_I64, 9 * LANES))
        first = builder.add(first, place)
        origin = [builder.load(builder.gep(sides, [axis])) for axis in axes]
        seen = [
            [
                _splat(builder, builder.fsub(_corner(builder, data, first, axis, corner), start))
                for axis, start in zip(axes, origin, strict=True)
            ]
            for corner in range(3)
        ]
        low = _splat(builder, least)

        def meet_row(row: Any) -> Any:
            shear_x, shear_y, shear_z, farthest = (
                _load(builder, lanes, builder.add(ir.Constant(_I64, k * PACKET // LANES), row))
                for k in range(4)
            )
            xs = [builder.fsub(x, builder.fmul(shear_x, z)) for x, _, z in seen]
            ys = [builder.fsub(y, builder.fmul(shear_y, z)) for _, y, z in seen]
            zs = [builder.fmul(shear_z, z) for _, _, z in seen]
            places = _rows_of_found(builder, row)
            return _meet(builder, xs, ys, zs, low, farthest, out, places)

        return _in_rows(builder, which, meet_row)

    return signature, codegen


@_intrinsic
def largest(typing_context, numbers, begin, groups):  # type: ignore[no-untyped-def]
    """Largest of ``8 * groups`` float32 numbers from number ``8 * begin`` on."""
    signature = types.float32(numbers, begin, groups)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, first, count = _unpack(context, builder, signature, args)
        most = _new_variable(builder, _load(builder, data, first))
        with cgutils.for_range(builder, count) as loop:
            value = _load(builder, data, builder.add(first, loop.index))
            builder.store(_larger(builder, builder.load(most), value), most)
        vector = builder.load(most)
        undefined = ir.Constant(_VEC, ir.Undefined)
        for half in (4, 2, 1):
            order = [k + half if k + half < LANES else k for k in range(LANES)]
            mask = ir.Constant(ir.VectorType(_I32, LANES), order)
            vector = _larger(builder, vector, builder.shuffle_vector(vector, undefined, mask))
        return builder.extract_element(vector, ir.Constant(_I32, 0))

    return signature, codegen


def _numbers(builder: Any, array: Any, places: range) -> list[Any]:
    """Numbers of a float32 array, each eight times."""
    return [
        _splat(builder, builder.load(builder.gep(array, [ir.Constant(_I64, place)])))
        for place in places
    ]


def _overlap(builder: Any, spans: list[tuple[Any, Any]], bounds: list[Any]) -> Any:
    """Where all intervals meet theirs of ``bounds``: least, largest, least, largest, ..."""
    met = None
    for k, (low, high) in enumerate(spans):
        both = builder.and_(
            builder.fcmp_ordered("<=", low, bounds[2 * k + 1]),
            builder.fcmp_ordered(">=", high, bounds[2 * k]),
        )
        met = both if met is None else builder.and_(met, both)
    return met


@_intrinsic
def boxes_in_shaft(typing_context, planes, node, shaft, entry):  # type: ignore[no-untyped-def]
    """Which of a node's eight boxes parallel rays may meet.

    Args:
        typing_context: numba's.
        planes, node: as for :func:`box_hits`.
        shaft: ``(>= 18,)`` float32: a place near all origins; two directions across the rays and
            their own; the least and largest place along each of the three that they reach.
        entry: ``(>= 8,)`` float32, receives where each box begins along the rays.

    Returns:
        int64 whose bit ``k`` says that box ``k`` may be met.
    """
    signature = types.int64(planes, node, shaft, entry)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, row, numbers, out = _unpack(context, builder, signature, args)
        first = builder.mul(row, ir.Constant(_I64, 6))
        origin = _numbers(builder, numbers, range(3))
        sides = [
            builder.fsub(
                _load(builder, data, builder.add(first, ir.Constant(_I64, k))), origin[k % 3]
            )
            for k in range(6)
        ]
        slack = builder.fmul(_reach(builder, sides[:3], sides[3:]), _constant(1e-6))
        spans = []
        for k in (3, 6, 9):
            vector = _numbers(builder, numbers, range(k, k + 3))
            least, most = _span(builder, vector, sides[:3], sides[3:])
            spans.append((builder.fsub(least, slack), builder.fadd(most, slack)))
        _store(builder, spans[2][0], out, 0)
        met = _overlap(builder, spans, _numbers(builder, numbers, range(12, 18)))
        exists = builder.fcmp_ordered("<=", sides[0], sides[3])
        return _bits(builder, builder.and_(met, exists))

    return signature, codegen


@_intrinsic
def triangles_in_shaft(typing_context, corners, block, shaft, places):  # type: ignore[no-untyped-def]
    """Which of a block's eight triangles parallel rays may meet, and where across them they are.

    Args:
        typing_context: numba's.
        corners, block: as for :func:`triangle_hits`.
        shaft: as for :func:`boxes_in_shaft`; and at last how far the origins are from its place.
        places: ``(>= 32,)`` float32, receives the least and the largest place of each triangle
            along the first and along the second direction.

    Returns:
        int64 whose bit ``k`` says that triangle ``k`` may be met.
    """
    signature = types.int64(corners, block, shaft, places)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, row, numbers, out = _unpack(context, builder, signature, args)
        origin = _numbers(builder, numbers, range(3))
        vectors = [_numbers(builder, numbers, range(k, k + 3)) for k in (3, 6, 9)]
        first = builder.mul(row, ir.Constant(_I64, 9))
        least: list[Any] = [None] * 3
        most: list[Any] = [None] * 3
        slack = None
        points: list[Any] = []
        sizes: list[Any] = []
        (around,) = _numbers(builder, numbers, range(18, 19))
        for corner in range(3):
            point = [
                builder.fsub(
                    _load(builder, data, builder.add(first, ir.Constant(_I64, 3 * corner + axis))),
                    origin[axis],
                )
                for axis in range(3)
            ]
            size = builder.fadd(
                builder.fadd(_magnitude(builder, point[0]), _magnitude(builder, point[1])),
                _magnitude(builder, point[2]),
            )
            slack = size if slack is None else _larger(builder, slack, size)
            sizes.append(builder.fadd(size, around))
            across = [_dot(builder, vector, point) for vector in vectors]
            points.append(across[:2])
            for k, value in enumerate(across):
                held, top = least[k], most[k]
                least[k] = value if held is None else _smaller(builder, held, value)
                most[k] = value if top is None else _larger(builder, top, value)
        slack = builder.fmul(slack, _constant(1e-6))
        spans = [
            (builder.fsub(low, slack), builder.fadd(high, slack))
            for low, high in zip(least, most, strict=True)
        ]
        for k in range(2):
            _store(builder, spans[k][0], out, 2 * k)
            _store(builder, spans[k][1], out, 2 * k + 1)
        bounds = _numbers(builder, numbers, range(12, 18))
        met = _overlap(builder, spans, bounds)
        return _bits(
            builder, builder.and_(met, _straddled_along(builder, points, sizes, bounds[:4]))
        )

    return signature, codegen


@_intrinsic
def parallel_rays_hit(  # type: ignore[no-untyped-def]
    typing_context, corners, block, lane, kx, ky, kz, starts, sx, sy, sz, rays, rows, low, found
):
    """Which of 64 parallel rays meet a triangle, at most as far as they have come.

    The operations are those of :func:`triangle_hits`, in the same order: the results are equal.

    Args:
        typing_context: numba's.
        corners, block, kx, ky, kz, sx, sy, sz: as for :func:`triangle_hits`.
        lane: the triangle.
        starts: ``(3, PACKET)`` float32 origins of the rays.
        rays: ``(4, PACKET)`` float32, in its last row the largest parameter that counts.
        rows: a bit for each eight of the rays that are asked.
        low: smallest parameter that counts.
        found: as for :func:`rays_hit`.

    Returns:
        int64 whose bit ``k`` says that ray ``k`` meets the triangle.
    """
    signature = types.int64(
        corners, block, lane, kx, ky, kz, starts, sx, sy, sz, rays, rows, low, found
    )

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        data, number, place, *axes, origins, sx, sy, sz, lanes, which, least, out = _unpack(
            context, builder, signature, args
        )
        stride = ir.Constant(_I64, PACKET // LANES)
        shear_x, shear_y, shear_z = (_splat(builder, value) for value in (sx, sy, sz))
        first = builder.add(builder.mul(number, ir.Constant(_I64, 9 * LANES)), place)
        corner_at = [
            [_splat(builder, _corner(builder, data, first, axis, corner)) for axis in axes]
            for corner in range(3)
        ]
        low = _splat(builder, least)

        def meet_row(row: Any) -> Any:
            start = [
                _load(builder, origins, builder.add(builder.mul(axis, stride), row))
                for axis in axes
            ]
            last = ir.Constant(_I64, 3 * PACKET // LANES)
            farthest = _load(builder, lanes, builder.add(last, row))
            xs, ys, zs = [], [], []
            for corner in corner_at:
                x, y, z = (builder.fsub(a, b) for a, b in zip(corner, start, strict=True))
                xs.append(builder.fsub(x, builder.fmul(shear_x, z)))
                ys.append(builder.fsub(y, builder.fmul(shear_y, z)))
                zs.append(builder.fmul(shear_z, z))
            places = _rows_of_found(builder, row)
            return _meet(builder, xs, ys, zs, low, farthest, out, places)

        return _in_rows(builder, which, meet_row)

    return signature, codegen


def _rows_between(
    builder: Any, bounds: Any, places: Any, lane: Any, spans: int
) -> tuple[Any, Callable[[int], Any]]:
    """Which rows of rays a triangle may reach across them; how to read its further places."""

    def place(row: int) -> Any:
        index = builder.add(lane, ir.Constant(_I64, row * LANES))
        return _splat(builder, builder.load(builder.gep(places, [index])))

    met = None
    for k in range(spans):
        low, high = (_load(builder, bounds, ir.Constant(_I64, 2 * k + end)) for end in range(2))
        both = builder.and_(
            builder.fcmp_unordered(">=", place(2 * k + 1), low),
            builder.fcmp_unordered("<=", place(2 * k), high),
        )
        met = both if met is None else builder.and_(met, both)
    return met, place


@_intrinsic
def rows_in_beam(typing_context, bounds, places, lane):  # type: ignore[no-untyped-def]
    """Which rows of eight rays of a beam a triangle may be met by.

    Args:
        typing_context: numba's.
        bounds: ``(>= 3, 8)`` float32 least and largest slope of each row along the second
            direction, and the parameter beyond which none of its rays wants a hit.
        places: as :func:`triangles_in_beam` leaves it.
        lane: the triangle.

    Returns:
        int64 with a bit for each row.
    """
    signature = types.int64(bounds, places, lane)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        rows, data, number = _unpack(context, builder, signature, args)
        met, place = _rows_between(builder, rows, data, number, 1)
        farthest = _load(builder, rows, ir.Constant(_I64, 2))
        near = builder.fcmp_unordered("<=", place(2), farthest)
        return _bits(builder, builder.and_(met, near))

    return signature, codegen


@_intrinsic
def rows_in_shaft(typing_context, bounds, places, lane):  # type: ignore[no-untyped-def]
    """Which rows of eight parallel rays a triangle may be met by.

    Args:
        typing_context: numba's.
        bounds: ``(>= 5, 8)`` float32 least and largest place of each row along the first and along
            the second direction across the rays, and a negative number where a row wants no hit.
        places: as :func:`triangles_in_shaft` leaves it.
        lane: the triangle.

    Returns:
        int64 with a bit for each row.
    """
    signature = types.int64(bounds, places, lane)

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        rows, data, number = _unpack(context, builder, signature, args)
        met, _ = _rows_between(builder, rows, data, number, 2)
        farthest = _load(builder, rows, ir.Constant(_I64, 4))
        wanted = builder.fcmp_ordered(">=", farthest, _constant(0.0))
        return _bits(builder, builder.and_(met, wanted))

    return signature, codegen
