"""The shape of a vehicle that the rig editor draws."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from carstage_sim.describe.vehicle_shape import UnknownVehicleError, vehicle_shape


@pytest.mark.parametrize("type_id", ["vehicle.tesla.model3", "vehicle.bh.crossbike"])
def test_outlines_and_triangles_fill_the_bounding_box(type_id: str) -> None:
    shape = vehicle_shape(type_id)
    location, extent = (np.array(shape["box"][key]) for key in ("location", "extent"))
    corners = np.concatenate([np.reshape(part["corners"], (-1, 3)) for part in shape["parts"]])
    low, high = location - extent, location + extent
    low[2] = 0.0  # tyres touch the ground, above or below which CARLA's boxes end
    np.testing.assert_array_less(low - 2e-3, corners.min(axis=0))
    np.testing.assert_array_less(corners.max(axis=0), high + 2e-3)
    for name, axes in (("top", [0, 1]), ("side", [0, 2])):
        ring = np.concatenate([np.array(ring) for ring in shape[name]])
        np.testing.assert_allclose(ring.min(axis=0), corners[:, axes].min(axis=0), atol=0.03)
        np.testing.assert_allclose(ring.max(axis=0), corners[:, axes].max(axis=0), atol=0.03)
        assert all(shapely.Polygon(ring).is_valid for ring in shape[name])


def test_wheels_stand_on_the_ground() -> None:
    wheels = vehicle_shape("vehicle.tesla.model3")["wheels"]
    assert len(wheels) == 4
    assert all(wheel["location"][2] == pytest.approx(wheel["radius"]) for wheel in wheels)


def test_what_is_no_vehicle_is_refused() -> None:
    with pytest.raises(UnknownVehicleError, match=r"sensor\.camera\.rgb"):
        vehicle_shape("sensor.camera.rgb")
