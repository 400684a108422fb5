"""Debug shapes: what ``carla.DebugHelper`` draws."""

from __future__ import annotations

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
    elif kind == 1:
        drawing.lines([_segment(body)], *values.finite(body[2]), rgb, now_s, life_s)
    elif kind == 2:
        line, head_m = body
        strokes = arrow(*_segment(line), *values.finite(head_m))
        drawing.lines(strokes, *values.finite(line[2]), rgb, now_s, life_s)
    elif kind == 3:
        box, rotation, thickness = body
        edges = box_edges(values.vector(box[0]), values.vector(box[1]), values.vector(rotation))
        drawing.lines(edges, *values.finite(thickness), rgb, now_s, life_s)
    elif not 4 <= kind <= 8:
        raise CallError(f"no debug shape has the number {kind}")


def _segment(line: list[Any]) -> Segment:
    return values.vector(line[0]), values.vector(line[1])


@handles_void("clear_debug_shape")
def _clear_debug_shape(call: Call) -> None:
    call.world.debug_drawing.clear()


@handles_void("clear_debug_string")
def _clear_debug_string(_call: Call) -> None:
    """Strings were never shown."""
