"""LiDARs that one can buy, by their data sheets, each with its source.

Ranges, channels, fields of view, rates and accuracies are those of the documents. A data sheet's
range accuracy becomes the standard deviation along the beam.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

LIDAR, SEMANTIC_LIDAR, FLASH_LIDAR = "lidar", "semantic_lidar", "flash_lidar"
SWEEPING_LIDAR, RAY_FLASH_LIDAR = "sweeping_lidar", "ray_flash_lidar"
SEMANTIC_FLASH_LIDARS = ("semantic_flash_lidar", "semantic_ray_flash_lidar")


@dataclass(frozen=True)
class LidarProduct:
    """A LiDAR that one can buy.

    Attributes:
        title: maker and model.
        kinds: kinds of sensors that it can be given to.
        attributes: of the sensor, by our names; a kind takes those that it has.
        source: the document that the figures are from.
        differs: what the sensor does otherwise than the product.
    """

    title: str
    kinds: tuple[str, ...]
    attributes: Mapping[str, Any]
    source: str
    differs: str


def _rotating(
    title: str,
    *,
    channels: int,
    fov_deg: tuple[float, float],
    range_m: float,
    points_per_second: int,
    noise_m: float,
    source: str,
    differs: str,
) -> LidarProduct:
    return LidarProduct(
        title,
        (LIDAR, SEMANTIC_LIDAR, SWEEPING_LIDAR),
        {
            "channels": channels,
            "lower_fov_deg": fov_deg[0],
            "upper_fov_deg": fov_deg[1],
            "range_m": range_m,
            "points_per_second": points_per_second,
            "rotation_frequency_hz": 10.0,
            "noise_stddev_m": noise_m,
        },
        source,
        differs,
    )


_OUSTER = (
    "Ouster, OS1 data sheet of the first generation; range on 80 % reflectivity, repeatability at "
    "a signal-to-noise ratio of 100"
)

#: Product by the name that `product` takes.
PRODUCTS: Mapping[str, LidarProduct] = {
    "velodyne_vlp16": _rotating(
        "Velodyne VLP-16 (Puck)", channels=16, fov_deg=(-15.0, 15.0), range_m=100.0,
        points_per_second=300_000, noise_m=0.03,
        source="Velodyne LiDAR, Puck data sheet 63-9229 and VLP-16 user manual 63-9243 rev. D",
        differs="one return",
    ),
    "velodyne_hdl32e": _rotating(
        "Velodyne HDL-32E", channels=32, fov_deg=(-30.67, 10.67), range_m=100.0,
        points_per_second=695_000, noise_m=0.02,
        source="Velodyne LiDAR, HDL-32E data sheet 97-0038",
        differs="one return",
    ),
    "velodyne_hdl64e": _rotating(
        "Velodyne HDL-64E S3", channels=64, fov_deg=(-24.9, 2.0), range_m=120.0,
        points_per_second=1_300_000, noise_m=0.02,
        source="Velodyne LiDAR, HDL-64E S3 user's manual 63-HDL64ES3",
        differs="one return; equal steps between lasers, not a finer upper block",
    ),
    "ouster_os1_64": _rotating(
        "Ouster OS1-64", channels=64, fov_deg=(-16.6, 16.6), range_m=120.0,
        points_per_second=1_310_720, noise_m=0.03, source=_OUSTER,
        differs="2048 columns at 10 Hz",
    ),
    "ouster_os1_128": _rotating(
        "Ouster OS1-128", channels=128, fov_deg=(-22.5, 22.5), range_m=120.0,
        points_per_second=2_621_440, noise_m=0.03, source=_OUSTER,
        differs="2048 columns at 10 Hz",
    ),
    "continental_hfl110": LidarProduct(
        "Continental HFL110",
        (FLASH_LIDAR, RAY_FLASH_LIDAR, *SEMANTIC_FLASH_LIDARS),
        {
            "columns": 128,
            "rows": 32,
            "horizontal_fov_deg": 120.0,
            "vertical_fov_deg": 30.0,
            "range_m": 50.0,
            "returns": "dual",
        },
        "Continental, product information 3D Flash LiDAR HFL110; pixels, range and returns as "
        "Continental's ROS driver `hfl_driver` (2019) has them",
        "`fps` gives its 25 Hz; no noise, as the documents name none; beams in equal angles",
    ),
}  # fmt: skip


def products_of(kind: str) -> tuple[str, ...]:
    """Names of the products that a kind of sensor can be."""
    return tuple(name for name, product in PRODUCTS.items() if kind in product.kinds)
