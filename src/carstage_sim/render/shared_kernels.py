"""The kernels of rays and colours, for threads that take the rays part by part."""

from __future__ import annotations

from carstage_sim.kernels import kernel
from carstage_sim.render.cast import cast_rays
from carstage_sim.render.packet_shading import shade_packets
from carstage_sim.render.packets import cast_packets
from carstage_sim.render.sharing import take


@kernel
def share_cast_rays(  # type: ignore[no-untyped-def]
    scene, scratch, origins, directions, low, high, skip, parts, t, row, triangle, weights
):
    """As :func:`carstage_sim.render.cast.cast_rays`, of ``parts`` of the rays."""
    first, last = take(parts)
    while first < last:
        cast_rays(
            scene, scratch, origins, directions, low, high, skip, first, last,
            t, row, triangle, weights,
        )  # fmt: skip
        first, last = take(parts)


@kernel
def share_cast_packets(  # type: ignore[no-untyped-def]
    scene, memory, origin, directions, order, starts, low, high, skip, parts,
    t, row, triangle, weights,
):  # fmt: skip
    """As :func:`carstage_sim.render.packets.cast_packets`, of ``parts`` of the packets."""
    first, last = take(parts)
    while first < last:
        cast_packets(
            scene, memory, origin, directions, order, starts, low, high, skip, first, last,
            t, row, triangle, weights,
        )  # fmt: skip
        first, last = take(parts)


@kernel
def share_shade_packets(frame, rays, memory, epic, order, starts, parts, out):  # type: ignore[no-untyped-def]
    """As :func:`carstage_sim.render.shading.shade_packets`, of ``parts`` of the packets."""
    first, last = take(parts)
    while first < last:
        shade_packets(frame, rays, memory, epic, order, starts, first, last, out)
        first, last = take(parts)
