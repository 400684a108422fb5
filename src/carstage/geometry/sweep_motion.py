"""The motion of a LiDAR while it sweeps, and points without it.

Over a sweep the motion is even. Half the turning times an age is the Gibbs vector of the rotation
in that time (Rodrigues 1840), so rotations need sums, products and quotients alone and have the
same bits on every processor. The angle itself then grows evenly to 3e-5 rad in a turn of 0.1 rad.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carstage.geometry.coordinates import FloatArray, multiply


@dataclass(frozen=True, slots=True)
class SweepMotion:
    """A sensor's even motion, in its own axes (CARLA's, left-handed) at the end of the sweep.

    Attributes:
        velocity: ``(3,)`` m/s.
        turning: ``(3,)`` rad/s about each axis.
    """

    velocity: FloatArray
    turning: FloatArray

    @classmethod
    def between(
        cls, world_from_before: FloatArray, world_from_now: FloatArray, span_s: float
    ) -> SweepMotion:
        """The motion from one pose to another, ``(4, 4)`` each, less than half a turn apart."""
        now = world_from_now[:3, :3]
        turned = multiply(world_from_before[:3, :3].T, now)
        across = np.array([turned[2, 1], turned[0, 2], turned[1, 0]])
        back = np.array([turned[1, 2], turned[2, 0], turned[0, 1]])
        gibbs = (across - back) / (1.0 + float(np.trace(turned)))
        way = world_from_now[:3, 3] - world_from_before[:3, 3]
        velocity = multiply(now.T, way[:, None])[:, 0] / span_s
        return cls(velocity, 2.0 * gibbs / span_s)

    def undone(self, points: FloatArray, age_s: FloatArray) -> FloatArray:
        """``(N, 3)`` points as the sensor would have them at the end, if they stood still.

        Args:
            points: ``(N, 3)`` m, in the sensor's axes when each was measured.
            age_s: ``(N,)`` how long before the end that was.
        """
        x, y, z = points.T
        a, b, c = (-0.5 * float(one) * age_s for one in self.turning)
        scale = 2.0 / (1.0 + a * a + b * b + c * c)
        u, v, w = b * z - c * y, c * x - a * z, a * y - b * x
        turned = np.stack(
            [
                x + scale * (u + b * w - c * v),
                y + scale * (v + c * u - a * w),
                z + scale * (w + a * v - b * u),
            ],
            axis=1,
        )
        return np.asarray(turned - age_s[:, None] * self.velocity)
