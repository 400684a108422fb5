"""How deep two upright boxes are in each other, seen from above: the separating axis theorem.

Ericson, "Real-Time Collision Detection" (2005), section 4.4.1.
"""

from __future__ import annotations

from carstage_sim.kernels import device


@device
def reach_along(x, y, cosine, sine, half_length, half_width):  # type: ignore[no-untyped-def]
    """How far a box reaches from its centre along an axis ``(x, y)``.

    Args:
        cosine, sine: of the box's heading.
    """
    return half_length * abs(x * cosine + y * sine) + half_width * abs(y * cosine - x * sine)


@device
def least_way_out(  # type: ignore[no-untyped-def]
    dx, dy, cosine_1, sine_1, half_length_1, half_width_1,
    cosine_2, sine_2, half_length_2, half_width_2,
):  # fmt: skip
    """Depth of the overlap, and the axis to push the second box along; not positive if apart.

    Args:
        dx, dy: from the first centre to the second.
    """
    depth, normal_x, normal_y = 1e300, 0.0, 0.0
    for k in range(4):
        if k < 2:
            x, y = cosine_1, sine_1
        else:
            x, y = cosine_2, sine_2
        if k % 2 == 1:
            x, y = -y, x
        distance = x * dx + y * dy
        reach = reach_along(x, y, cosine_1, sine_1, half_length_1, half_width_1)
        reach += reach_along(x, y, cosine_2, sine_2, half_length_2, half_width_2)
        here = reach - abs(distance)
        if here < depth:
            sign = -1.0 if distance < 0.0 else 1.0
            depth, normal_x, normal_y = here, sign * x, sign * y
            if depth <= 0.0:
                break
    return depth, normal_x, normal_y
