"""How vehicles stand on the ground: height, pitch and roll from the road under their wheels.

Once per tick, after the motion in the plane: where the body would go if the road went on as it was,
then what the four wheels find there. Springs even out the difference, so that a kerb or a seam of
the mesh is a short ramp and no jump; on an even slope there is none, and the vehicle follows
exactly. Without ground under at least two wheels it falls freely.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from carstage_sim.world.columns import Rotation
from carstage_sim.world.vehicles.dynamics import GRAVITY
from carstage_sim.world.vehicles.rows import VehicleRows

FloatArray = NDArray[np.float64]

GroundHeight = Callable[[FloatArray], FloatArray]
"""Height, ``(M,)`` metres, of the ground under points ``(M, 3)`` of the world; NaN for none."""

_SPRING_TRAVEL_M = 0.2  # the wheels keep contact with ground that drops by no more than this
_SPRING_TIME_S = 0.08
_AT_REST_M = 1e-4
_AT_REST_DEG = 1e-3
_CARRYING_WHEELS = 2
_STEEPEST_RAD = np.pi / 4.0  # who lies on its nose or side has no wheels under it


def flat_ground(points: FloatArray) -> FloatArray:
    """The plane at height 0, which is no ground for what is below it."""
    return np.where(points[:, 2] >= -0.6, 0.0, np.nan)


def follow_ground(
    rows: VehicleRows, ground: GroundHeight, moved_from: FloatArray, dt_s: float
) -> None:
    """Sets height, pitch and roll of all simulated vehicles, in place.

    Args:
        moved_from: ``(N, 3)`` locations before the motion in the plane.
        dt_s: seconds that the motion took.
    """
    pitch, yaw, roll = np.radians(rows.rotation_deg).T
    forward = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    right = np.stack([-forward[:, 1], forward[:, 0]], axis=-1)
    way = rows.location[:, :2] - moved_from[:, :2]
    climb = np.einsum("nk,nk->n", way, forward) * np.tan(pitch)
    climb -= np.einsum("nk,nk->n", way, right) * np.tan(roll)

    gravity = np.where(rows.gravity, GRAVITY, 0.0)
    lift = rows.force[:, 2] * rows.inverse_mass - gravity
    free = rows.airborne | (lift > 0.0)
    before = rows.location[:, 2]
    rises = rows.vertical_speed * dt_s + 0.5 * lift * dt_s**2
    expected = before + np.where(free, rises, climb)

    found, pitch_deg, roll_deg, carried = _road_plane(
        rows, ground, forward, right, expected, before
    )
    gap = expected - found
    lands = carried & (gap <= np.where(free, 0.0, _SPRING_TRAVEL_M))
    settles = np.exp(-dt_s / _SPRING_TIME_S)
    # What comes down has its springs pressed in at once.
    kept = np.where(free, 0.0, settles)
    offset = gap * kept
    offset = np.where(np.abs(offset) < _AT_REST_M, 0.0, offset)

    simulated = rows.simulated
    stands = simulated & lands
    flies = simulated & ~lands
    rows.location[:, 2] = np.where(stands, found + offset, np.where(flies, expected, before))
    rows.vertical_speed = np.where(
        flies, np.where(free, rows.vertical_speed + lift * dt_s, climb / dt_s), 0.0
    )
    rows.airborne = np.where(simulated, flies, rows.airborne)
    for column, target in ((0, pitch_deg), (2, roll_deg)):
        lag = (rows.rotation_deg[:, column] - target) * kept
        lag = np.where(np.abs(lag) < _AT_REST_DEG, 0.0, lag)
        rows.rotation_deg[stands, column] = (target + lag)[stands]


def time_to_land(rows: VehicleRows, ground: GroundHeight) -> FloatArray:
    """Seconds until each vehicle stands on the ground, ``(N,)``; 0 for those that do.

    Controls must work from then on and not from the next tick, or a long tick would cost a vehicle
    that was just spawned more of its drive than a short one.
    """
    waits = np.where(rows.airborne, np.inf, 0.0)
    if not rows.airborne.any():
        return waits
    yaw = np.radians(rows.rotation_deg[:, Rotation.YAW])
    forward = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    right = np.stack([-forward[:, 1], forward[:, 0]], axis=-1)
    height = rows.location[:, 2]
    found, _, _, carried = _road_plane(rows, ground, forward, right, height, height)
    above = np.maximum(height - found, 0.0)
    rise = rows.vertical_speed
    lands = rows.airborne & carried & (rows.gravity | ((above < _AT_REST_M) & (rise <= 0.0)))
    falls = (rise + np.sqrt(rise**2 + 2.0 * GRAVITY * above)) / GRAVITY
    return np.where(lands, falls, waits)


def _road_plane(
    rows: VehicleRows,
    ground: GroundHeight,
    forward: FloatArray,
    right: FloatArray,
    height: FloatArray,
    highest: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.bool_]]:
    """The plane under the wheels of vehicles at some height.

    Returns:
        Its height under the origin (m), pitch and roll (deg), and whether it carries the vehicle.
    """
    count = len(rows.ids)
    x = np.stack([rows.front_axle_x, rows.front_axle_x, rows.rear_axle_x, rows.rear_axle_x])
    y = np.stack([-rows.half_track, rows.half_track, -rows.half_track, rows.half_track])
    pitch = np.radians(rows.rotation_deg[:, Rotation.PITCH])
    roll = np.radians(rows.rotation_deg[:, Rotation.ROLL])
    wheels = np.empty((4, count, 3))
    wheels[..., :2] = rows.location[:, :2] + x[..., None] * forward + y[..., None] * right
    lies = np.maximum(np.abs(pitch), np.abs(roll)) > _STEEPEST_RAD
    tilt = np.where(lies, 0.0, x * np.tan(pitch) - y * np.tan(roll))
    # Something that falls must not fall through in one tick: looked at from where it came from.
    wheels[..., 2] = np.maximum(height, highest) + tilt
    z = ground(wheels.reshape(-1, 3)).reshape(4, count)
    missing = np.isnan(z)
    sunk = missing & (tilt < 0.0)
    if sunk.any():
        # Deep in the ground, as of who comes down askew: looked at from the vehicle's own height.
        wheels[..., 2] -= tilt
        z[sunk] = ground(wheels[sunk])
        missing = np.isnan(z)
    if missing.any():
        z = np.where(missing, height + tilt, z)
    front, rear = 0.5 * (z[0] + z[1]), 0.5 * (z[2] + z[3])
    left, right_side = 0.5 * (z[0] + z[2]), 0.5 * (z[1] + z[3])
    wheelbase = rows.front_axle_x - rows.rear_axle_x
    pitch_deg = np.degrees(np.arctan2(front - rear, wheelbase))
    # Two-wheelers have no track: they stay upright.
    roll_deg = np.degrees(np.arctan2(left - right_side, np.maximum(2.0 * rows.half_track, 0.1)))
    origin = rear + (front - rear) * (-rows.rear_axle_x / wheelbase)
    carried = 4 - missing.sum(axis=0) >= _CARRYING_WHEELS
    return origin, pitch_deg, roll_deg, carried
