"""Camera models beyond the plain pinhole: points to pixels, pixels to rays, and what depth means.

A lens is given in pixels of its picture and in optical axes (x right, y down, z forward); pixel
coordinates are those of ``carstage.geometry.camera``. Formulas: OpenCV's documentation, modules
``calib3d`` (Brown-Conrady: "Camera Calibration and 3D Reconstruction") and ``fisheye``
(Kannala and Brandt 2006: "A Generic Camera Model"). OpenCV counts pixels from the centre of the
first one: its principal point is ours minus 0.5.

Only sums, products, roots and functions of ``math`` are used, so that labels have the same bits on
every processor.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage.errors import BadInputError
from carstage.geometry.camera import Z_NEAR_M
from carstage.geometry.coordinates import FloatArray, arctan2, length

_SIN = np.vectorize(math.sin, otypes=[np.float64])
_COS = np.vectorize(math.cos, otypes=[np.float64])
_TABLE_STEPS: Final = 4096
_WIDEST_PLANE_RAD: Final = math.radians(89.0)
"""Nothing is projected to an image plane beyond this angle."""
_BEYOND_CORNERS: Final = 2.0
"""Of a Brown-Conrady lens, times the radius of its picture's corners to which it is followed."""
_ROUNDS: Final = 12
_EXACT: Final = 1e-9
"""Largest error of an undistorted pixel, as a share of the focal length."""
_EDGE: Final = 1e-7
"""By how much rounding may move a ray of the image circle, as a share of its radius."""


@dataclass(frozen=True, slots=True)
class Lens(ABC):
    """A camera model.

    Attributes:
        width, height: size of the picture (px).
        fx, fy: focal lengths (px); px per radian of an equirectangular picture.
        cx, cy: principal point (px).
        distortion: coefficients in OpenCV's order.
        limit_rad: angle to the optical axis beyond which it shows nothing.
        model: the name in configurations and calibrations.
        depth_is_range: whether depth is the distance along the ray; else along the optical axis.
        wraps: whether the left and the right edge of the picture are one line of the world.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    limit_rad: float = math.pi

    model: ClassVar[str]
    depth_is_range: ClassVar[bool]
    wraps: ClassVar[bool] = False

    @property
    def k(self) -> FloatArray:
        """``(3, 3)`` matrix of the focal lengths and the principal point."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    @abstractmethod
    def max_angle_rad(self) -> float:
        """Angle to the optical axis up to which rays have pixels, one to one."""

    @abstractmethod
    def to_edge(self, points_optical: ArrayLike) -> FloatArray:
        """Pixel coordinates ``(..., 2)`` of points ``(..., 3)`` in any direction.

        Those beyond :attr:`max_angle_rad` lie where a ray of that angle and their azimuth does.
        """

    @abstractmethod
    def rays(self, uv: ArrayLike) -> FloatArray:
        """Rays ``(..., 3)`` in optical axes of pixel coordinates; NaN where the lens shows nothing.

        A ray times the depth of its pixel is the point: of length 1 where depth is a range, with
        ``z = 1`` elsewhere.
        """

    def project(self, points_optical: ArrayLike) -> FloatArray:
        """Pixel coordinates ``(..., 2)`` of points ``(..., 3)``; NaN where the lens shows none."""
        points = np.asarray(points_optical, dtype=np.float64)
        uv = self.to_edge(points)
        uv[~self.shows(points)] = np.nan
        return uv

    def shows(self, points_optical: ArrayLike) -> NDArray[np.bool_]:
        """``(...)`` whether the lens maps points, inside its picture or beyond."""
        points = np.asarray(points_optical, dtype=np.float64)
        across = np.sqrt(points[..., 0] ** 2 + points[..., 1] ** 2)
        near = points[..., 2] if not self.depth_is_range else length(points)
        seen = (arctan2(across, points[..., 2]) <= self.max_angle_rad) & (near >= Z_NEAR_M)
        return np.asarray(seen, dtype=np.bool_)

    def depth(self, points_optical: ArrayLike) -> FloatArray:
        """Depth ``(...)`` of points in this model's own sense (m)."""
        points = np.asarray(points_optical, dtype=np.float64)
        return length(points) if self.depth_is_range else points[..., 2].copy()


@dataclass(frozen=True, slots=True)
class BrownConrady(Lens):
    """A pinhole with radial and tangential distortion ``k1, k2, p1, p2, k3``; without any: none."""

    model: ClassVar = "brown_conrady"
    depth_is_range: ClassVar = False

    @property
    def is_pinhole(self) -> bool:
        """Whether it has no distortion."""
        return not any(self.distortion)

    @property
    def max_angle_rad(self) -> float:
        """See ``Lens.max_angle_rad``; a little beyond the corners of the picture at most."""
        return _brown_limit(self)

    def to_edge(self, points_optical: ArrayLike) -> FloatArray:
        """See ``Lens.to_edge``."""
        points = np.asarray(points_optical, dtype=np.float64)
        x, y, z = points[..., 0], points[..., 1], points[..., 2]
        across = np.sqrt(x * x + y * y)
        farthest = math.tan(self.max_angle_rad)
        inside = across <= farthest * z
        scale = np.where(inside, 1.0, farthest) / np.where(inside, np.maximum(z, 1e-12), across)
        x, y = _distorted(x * scale, y * scale, self._coefficients())
        return np.stack([self.fx * x + self.cx, self.fy * y + self.cy], axis=-1)

    def rays(self, uv: ArrayLike) -> FloatArray:
        """See ``Lens.rays``: Newton's method from the radial distortion's inverse."""
        pixels = np.asarray(uv, dtype=np.float64)
        wanted_x, wanted_y = (
            (pixels[..., 0] - self.cx) / self.fx,
            (pixels[..., 1] - self.cy) / self.fy,
        )
        coefficients, farthest = self._coefficients(), math.tan(self.max_angle_rad)
        k1, k2, p1, p2, k3 = coefficients
        radii = np.linspace(0.0, farthest, _TABLE_STEPS)
        bent = radii * (1.0 + radii**2 * (k1 + radii**2 * (k2 + radii**2 * k3)))
        wanted = np.sqrt(wanted_x**2 + wanted_y**2)
        first = np.interp(wanted, bent, radii) / np.maximum(wanted, 1e-12)
        x, y = wanted_x * first, wanted_y * first
        for _ in range(_ROUNDS if any(coefficients) else 0):
            r2 = x * x + y * y
            radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
            slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))
            bent_x, bent_y = _distorted(x, y, coefficients)
            off_x, off_y = bent_x - wanted_x, bent_y - wanted_y
            xx = radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x
            xy = x * y * slope + 2.0 * (p1 * x + p2 * y)
            yy = radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x
            scale = xx * yy - xy * xy
            scale = np.where(scale > 0.0, scale, np.nan)  # beyond where the lens is one to one
            x, y = x - (yy * off_x - xy * off_y) / scale, y - (xx * off_y - xy * off_x) / scale
        bent_x, bent_y = _distorted(x, y, coefficients)
        exact = np.maximum(np.abs(bent_x - wanted_x), np.abs(bent_y - wanted_y)) <= _EXACT
        seen = exact & (np.sqrt(x * x + y * y) <= farthest * (1.0 + _EDGE))
        x, y = np.where(seen, x, np.nan), np.where(seen, y, np.nan)
        return np.stack([x, y, np.where(seen, 1.0, np.nan)], axis=-1)

    def _coefficients(self) -> tuple[float, float, float, float, float]:
        k1, k2, p1, p2, k3 = self.distortion or (0.0,) * 5
        return k1, k2, p1, p2, k3


@dataclass(frozen=True, slots=True)
class KannalaBrandt(Lens):
    """A fisheye of radius ``theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)``."""

    model: ClassVar = "kannala_brandt"
    depth_is_range: ClassVar = True

    @property
    def max_angle_rad(self) -> float:
        """See ``Lens.max_angle_rad``: where the polynomial stops to grow."""
        return _fisheye_limit(self)

    def to_edge(self, points_optical: ArrayLike) -> FloatArray:
        """See ``Lens.to_edge``."""
        points = np.asarray(points_optical, dtype=np.float64)
        x, y, z = points[..., 0], points[..., 1], points[..., 2]
        across = np.sqrt(x * x + y * y)
        theta = np.minimum(arctan2(across, z), self.max_angle_rad)
        scale = self._bent(theta) / np.maximum(across, 1e-12)
        return np.stack([self.fx * x * scale + self.cx, self.fy * y * scale + self.cy], axis=-1)

    def rays(self, uv: ArrayLike) -> FloatArray:
        """See ``Lens.rays``: Newton's method from a table of the polynomial."""
        pixels = np.asarray(uv, dtype=np.float64)
        x, y = (pixels[..., 0] - self.cx) / self.fx, (pixels[..., 1] - self.cy) / self.fy
        wanted = np.sqrt(x * x + y * y)
        angles = np.linspace(0.0, self.max_angle_rad, _TABLE_STEPS)
        bent = self._bent(angles)
        theta = np.interp(wanted, bent, angles)
        for _ in range(3):
            slope = _fisheye_slope(theta, self.distortion)
            theta = theta - (self._bent(theta) - wanted) / np.maximum(slope, 1e-3)
        seen = wanted <= bent[-1] * (1.0 + _EDGE)
        across = _SIN(theta) / np.maximum(wanted, 1e-12)
        rays = np.stack([x * across, y * across, _COS(theta)], axis=-1)
        rays[~seen] = np.nan
        return rays

    def _bent(self, theta: FloatArray) -> FloatArray:
        k1, k2, k3, k4 = self.distortion or (0.0,) * 4
        t2 = theta * theta
        return np.asarray(theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))))


@dataclass(frozen=True, slots=True)
class Equirectangular(Lens):
    """The whole sphere: columns are azimuths (to the right), rows are elevations (from the top)."""

    model: ClassVar = "equirectangular"
    depth_is_range: ClassVar = True
    wraps: ClassVar = True

    @property
    def max_angle_rad(self) -> float:
        """See ``Lens.max_angle_rad``: it shows all directions."""
        return math.pi

    def to_edge(self, points_optical: ArrayLike) -> FloatArray:
        """See ``Lens.to_edge``."""
        points = np.asarray(points_optical, dtype=np.float64)
        x, y, z = points[..., 0], points[..., 1], points[..., 2]
        below = arctan2(y, np.sqrt(x * x + z * z))
        return np.stack([self.fx * arctan2(x, z) + self.cx, self.fy * below + self.cy], axis=-1)

    def rays(self, uv: ArrayLike) -> FloatArray:
        """See ``Lens.rays``."""
        pixels = np.asarray(uv, dtype=np.float64)
        azimuth, below = (pixels[..., 0] - self.cx) / self.fx, (pixels[..., 1] - self.cy) / self.fy
        flat = _COS(below)
        rays = np.stack([_SIN(azimuth) * flat, _SIN(below), _COS(azimuth) * flat], axis=-1)
        rays[np.abs(below) > math.pi / 2.0 + 1e-12] = np.nan
        return rays


_LENSES: Final[dict[str, type[Lens]]] = {
    "pinhole": BrownConrady,
    BrownConrady.model: BrownConrady,
    KannalaBrandt.model: KannalaBrandt,
    Equirectangular.model: Equirectangular,
}


def lens_of(
    model: str,
    size: tuple[int, int],
    focal: tuple[float, float],
    center: tuple[float, float],
    distortion: Sequence[float] = (),
    max_angle_deg: float = 180.0,
) -> Lens:
    """The camera model of that name.

    Args:
        model: ``pinhole``, ``brown_conrady``, ``kannala_brandt`` or ``equirectangular``.
        size: width and height of the picture (px).
        focal: fx and fy (px).
        center: cx and cy (px).
        distortion: coefficients in OpenCV's order.
        max_angle_deg: angle to the optical axis beyond which the lens shows nothing.

    Raises:
        BadInputError: there is no such model.
    """
    if model not in _LENSES:
        raise BadInputError(f"No camera model {model!r}.", f"Known: {', '.join(_LENSES)}.")
    limit = math.radians(max_angle_deg)
    return _LENSES[model](*size, *focal, *center, tuple(distortion), limit)


@lru_cache(maxsize=8)
def pixel_rays(lens: Lens) -> FloatArray:
    """``(H, W, 3)`` rays of all pixels' centres, see ``Lens.rays``; not to be written to."""
    u, v = np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5
    if lens.wraps:  # few angles make all rays
        equator, meridian = lens.rays(_beside(u, lens.cy)), lens.rays(_beside(lens.cx, v))
        rays = np.stack(
            np.broadcast_arrays(
                equator[None, :, 0] * meridian[:, None, 2],
                meridian[:, None, 1],
                equator[None, :, 2] * meridian[:, None, 2],
            ),
            axis=-1,
        )
    else:
        rays = lens.rays(np.stack(np.meshgrid(u, v), axis=-1))
    rays.flags.writeable = False
    return rays


def lens_mask(lens: Lens) -> NDArray[np.bool_]:
    """``(H, W)`` which pixels show something; the others lie outside the lens's image circle."""
    return np.asarray(~np.isnan(pixel_rays(lens)[..., 0]), dtype=np.bool_)


def horizontal_fov_deg(lens: Lens) -> float:
    """Angle that the row through the principal point spans, at most twice the lens's largest."""
    rays = lens.rays(_beside(np.array([0.0, float(lens.width)]), lens.cy))
    largest = math.degrees(lens.max_angle_rad)
    if lens.wraps:
        return 2.0 * largest
    angles = [math.degrees(math.atan2(abs(ray[0]), ray[2])) for ray in rays.tolist()]
    return sum(largest if math.isnan(angle) else angle for angle in angles)


def _beside(u: ArrayLike, v: ArrayLike) -> FloatArray:
    return np.stack(np.broadcast_arrays(np.asarray(u, np.float64), v), axis=-1)


def _distorted(
    x: FloatArray, y: FloatArray, coefficients: tuple[float, float, float, float, float]
) -> tuple[FloatArray, FloatArray]:
    """Distorted coordinates in the plane ``z = 1``."""
    k1, k2, p1, p2, k3 = coefficients
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    bent_x = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    bent_y = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    return bent_x, bent_y


def _fisheye_slope(theta: FloatArray, distortion: tuple[float, ...]) -> FloatArray:
    """Derivative of the fisheye's polynomial."""
    k1, k2, k3, k4 = distortion or (0.0,) * 4
    t2 = theta * theta
    slope = 1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)))
    return np.asarray(slope, dtype=np.float64)


@lru_cache(maxsize=256)
def _fisheye_limit(lens: KannalaBrandt) -> float:
    return _growing_up_to(
        lambda t: _fisheye_slope(t, lens.distortion), min(lens.limit_rad, math.pi)
    )


@lru_cache(maxsize=256)
def _brown_limit(lens: BrownConrady) -> float:
    k1, k2, _, _, k3 = lens._coefficients()

    def slope(r: FloatArray) -> FloatArray:
        r2 = r * r
        return np.asarray(1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + r2 * 7.0 * k3)))

    farthest = _growing_up_to(slope, math.tan(min(lens.limit_rad, _WIDEST_PLANE_RAD)))
    radii = np.linspace(0.0, farthest, _TABLE_STEPS)
    bent = radii * (1.0 + radii**2 * (k1 + radii**2 * (k2 + radii**2 * k3)))
    corner = math.hypot(
        max(lens.cx, lens.width - lens.cx) / lens.fx, max(lens.cy, lens.height - lens.cy) / lens.fy
    )
    corner = float(np.interp(corner, bent, radii))
    return math.atan(min(farthest, _BEYOND_CORNERS * corner))


def _growing_up_to(slope: Callable[[FloatArray], FloatArray], most: float) -> float:
    """Where a slope first falls to 0, or ``most``."""
    at = np.linspace(0.0, most, _TABLE_STEPS)
    falling = np.flatnonzero(slope(at) <= 0.0)
    if not len(falling):
        return most
    low, high = float(at[falling[0] - 1]), float(at[falling[0]])
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (middle, high) if float(slope(np.array(middle))) > 0.0 else (low, middle)
    return low
