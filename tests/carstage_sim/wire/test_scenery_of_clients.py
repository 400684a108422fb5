"""Boxes that clients get of signs and traffic lights bound what their tags are painted on."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.content.solids import placed
from carstage_sim.content.street_furniture import stop_sign_mesh, traffic_light_mesh
from carstage_sim.geometry import pose_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.town import LevelObject, OrientedBox, TrafficLightSite
from carstage_sim.mesh import TriangleMesh
from carstage_sim.wire.scenery import light_heads, light_masts, sign_faces

SITE = TrafficLightSite(
    sign_id="7",
    location=(10.0, 20.0, 1.0),
    rotation_deg=(0.0, 30.0, 0.0),
    head=(5.0, 0.0, 5.4, 75.0),
    junction_id=1,
    phase=0,
    trigger=(),
)


def tagged(mesh: TriangleMesh, tag: int, world_from_mesh: np.ndarray) -> np.ndarray:
    points = mesh.vertices[mesh.triangles[mesh.tag == tag].ravel()].astype(np.float64)
    return points @ world_from_mesh[:3, :3].T + world_from_mesh[:3, 3]


def in_box(points: np.ndarray, box: OrientedBox) -> np.ndarray:
    local = (
        np.linalg.inv(pose_matrix(box.center, box.rotation_deg))
        @ np.c_[points, np.ones(len(points))].T
    )
    return local[:3].T / np.array(box.extent)


def test_the_heads_of_a_light_fill_their_boxes():
    mesh = traffic_light_mesh(SITE.head)
    points = tagged(
        mesh, CityObjectLabel.TRAFFIC_LIGHT, pose_matrix(SITE.location, SITE.rotation_deg)
    )
    heads = list(light_heads([SITE, SITE]))
    assert len({head.object_id for head in heads}) == len(heads) == 4
    found = np.zeros(len(points), bool)
    for head in heads[:2]:
        shares = np.abs(in_box(points, head.box))
        inside = (shares <= 1.0 + 1e-4).all(axis=1)
        found |= inside
        assert shares[inside].max(axis=0) == pytest.approx(1.0, abs=1e-3)
    assert found.all()


def test_the_mast_of_a_light_lies_in_its_box():
    mesh = traffic_light_mesh(SITE.head)
    points = tagged(mesh, CityObjectLabel.POLES, pose_matrix(SITE.location, SITE.rotation_deg))
    (mast,) = light_masts([SITE])
    assert np.abs(in_box(points, mast.box)).max(axis=0) == pytest.approx(1.0, abs=1e-3)


def test_the_box_of_a_sign_is_its_face_without_the_post():
    sign = placed(stop_sign_mesh(), (3.0, 4.0, 0.5), yaw_deg=40.0, object_id=1)
    whole = OrientedBox((3.0, 4.0, 2.0), (1.0, 1.0, 2.0), (0.0, 40.0, 0.0))
    piece = LevelObject(1, "Stop_1", int(CityObjectLabel.TRAFFIC_SIGNS), whole)
    (face,) = sign_faces(sign, [piece]).values()
    assert face.rotation_deg == whole.rotation_deg
    assert face.extent[0] < 0.05
    assert face.extent[1:] == pytest.approx((0.37, 0.37), abs=0.005)
    points = tagged(sign, CityObjectLabel.TRAFFIC_SIGNS, np.eye(4))
    assert np.abs(in_box(points, face)).max(axis=0) == pytest.approx(1.0, abs=5e-3)
