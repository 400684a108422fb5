"""The kernels of rays and colours, for a crew of threads that takes the rays part by part.

Each has the data of what it names, the working memory of all threads first, then the crew's board,
the job's row there, and its items.
"""

from __future__ import annotations

from carstage_sim.kernels import device, kernel
from carstage_sim.render.cast import cast_rays, scratch_of
from carstage_sim.render.crew import do
from carstage_sim.render.film import develop
from carstage_sim.render.packet_shading import shade_packets, shade_scratch_of
from carstage_sim.render.packets import cast_packets, packet_scratch_of
from carstage_sim.render.pixel_kernels import aim_ray


@device
def _cast_part(  # type: ignore[no-untyped-def]
    scratch, scene, origins, directions, low, high, skip, t, row, triangle, weights,
    worker, first, last,
):  # fmt: skip
    cast_rays(
        scene, scratch_of(scratch, worker), origins, directions, low, high, skip, first, last,
        t, row, triangle, weights,
    )  # fmt: skip


@kernel
def share_cast_rays(data, board, job, work):  # type: ignore[no-untyped-def]
    """As :func:`carstage_sim.render.cast.cast_rays`."""
    do(_cast_part, data, board, job, work)


@device
def _cast_packets_part(  # type: ignore[no-untyped-def]
    memory, scene, origin, directions, order, starts, low, high, skip, t, row, triangle, weights,
    rotation, right, up, worker, first, last,
):  # fmt: skip
    if right.shape[0]:
        for place in range(starts[first], starts[last]):
            aim_ray(rotation, right, up, order[place], directions)
    cast_packets(
        scene, packet_scratch_of(memory, worker), origin, directions, order, starts, low, high,
        skip, first, last, t, row, triangle, weights,
    )  # fmt: skip


@kernel
def share_cast_packets(data, board, job, work):  # type: ignore[no-untyped-def]
    """As :func:`carstage_sim.render.packets.cast_packets`; rays with slopes are aimed before.

    The last of the data are a :class:`carstage_sim.render.caster.Slopes`.
    """
    do(_cast_packets_part, data, board, job, work)


@device
def _shade_part(  # type: ignore[no-untyped-def]
    memory, frame, rays, epic, order, starts, out, codes, pixels, worker, first, last
):
    shade_packets(
        frame, rays, shade_scratch_of(memory, worker), epic, order, starts, first, last, out
    )
    if pixels.shape[0]:
        for place in range(starts[first], starts[last]):
            i = order[place]
            develop(codes, out[i, 0], out[i, 1], out[i, 2], i, pixels)


@kernel
def share_shade_packets(data, board, job, work):  # type: ignore[no-untyped-def]
    """As :func:`carstage_sim.render.shading.shade_packets`; pixels are developed at once.

    The last of the data are codes of the film's gamma and ``(N, 4)`` uint8 BGRA that receives the
    pixels, or none.
    """
    do(_shade_part, data, board, job, work)
