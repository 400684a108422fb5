"""Debug shapes: what ``carla.DebugHelper`` draws."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from carstage_sim.wire import values
from carstage_sim.wire.errors import CallError
from carstage_sim.wire.handlers.registry import Call, handles_void
from carstage_sim.world.debug_shapes import Segment, arrow, box_edges

_PIXELS_PER_SIZE = 100.0
"""CARLA gives Unreal the size of a point in centimetres; Unreal takes it as pixels."""


@handles_void("draw_debug_shape")
def _draw_debug_shape(call: Call, shape: list[Any]) -> None:
    """Points, lines, arrows and boxes. Strings and HUD shapes belong to a window: none is here."""
    (kind, body), colour, life_s, _persistent = shape
    (life_s,) = values.finite(life_s)
    rgb = values.colour(colour)
    drawing, now_s = call.world.debug_drawing, call.world.elapsed_s
    if kind == 0:
        place, size = body
        (size,) = values.finite(size)
        drawing.point(values.vector(place), _PIXELS_PER_SIZE * size, rgb, now_s, life_s)
    elif kind in _LINES:
        segments, width_m = _LINES[kind](body)
        drawing.lines(segments, width_m, rgb, now_s, life_s)
    elif not 4 <= kind <= 8:
        raise CallError(f"no debug shape has the number {kind}")


def _line(body: list[Any]) -> tuple[list[Segment], float]:
    begin, end, thickness = body
    (width_m,) = values.finite(thickness)
    return [(values.vector(begin), values.vector(end))], width_m


def _arrow(body: list[Any]) -> tuple[list[Segment], float]:
    line, head = body
    (head_m,) = values.finite(head)
    ((segment,), width_m) = _line(line)
    return arrow(*segment, head_m), width_m


def _box(body: list[Any]) -> tuple[list[Segment], float]:
    box, rotation, thickness = body
    (width_m,) = values.finite(thickness)
    edges = box_edges(values.vector(box[0]), values.vector(box[1]), values.vector(rotation))
    return edges, width_m


_LINES: dict[int, Callable[[list[Any]], tuple[list[Segment], float]]] = {
    1: _line,
    2: _arrow,
    3: _box,
}
"""Lines, and their width in metres, of the shapes that consist of lines, by their number."""


@handles_void("clear_debug_shape")
def _clear_debug_shape(call: Call) -> None:
    call.world.debug_drawing.clear()


@handles_void("clear_debug_string")
def _clear_debug_string(_call: Call) -> None:
    """Strings were never shown."""
