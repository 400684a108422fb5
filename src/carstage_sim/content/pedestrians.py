"""Procedural pedestrians: figures of human width, standing, walking, running or posed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from carstage_sim.content.figures import figure_of
from carstage_sim.content.lofting import Array
from carstage_sim.content.people import dress_of, has_umbrella, stoop_m
from carstage_sim.content.posing import Figure, Pose, stacked
from carstage_sim.content.walking import Vector, head_size, joints_at, size_m
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import TriangleMesh, build_mesh


def pedestrian_mesh(
    type_id: str, extent: Vector, joints: Pose, *, umbrella: bool = False
) -> TriangleMesh:
    """A pedestrian in its actor's frame: x forward, y right, origin at mid height.

    CARLA's box of a walker is its collision capsule's, which is narrower than a human: arms and
    legs leave it, as they do in CARLA. In every pose the same triangles follow each other.

    Args:
        type_id: blueprint id; dress and proportions follow from it.
        extent: half sizes of the capsule's box, metres; the figure is as tall as the box.
        joints: where its joints are, see :func:`walking_joints`.
        umbrella: who has one has it open, in place of what the hand holds else.
    """
    figure = _figure(type_id, extent, umbrella)
    return _mesh(figure, figure.vertices(joints))


def walking_meshes(
    type_id: str, extent: Vector, phases: Sequence[int], *, umbrella: bool = False
) -> list[TriangleMesh]:
    """A pedestrian in several phases at once, which takes half the time; see above.

    Raises:
        ValueError: there is no such phase.
    """
    figure = _figure(type_id, extent, umbrella)
    joints = stacked([walking_joints(type_id, extent, phase) for phase in phases])
    return [_mesh(figure, vertices) for vertices in figure.vertices(joints)]


def _figure(type_id: str, extent: Vector, umbrella: bool) -> Figure:
    size = size_m(extent)
    dress = replace(dress_of(type_id), head=head_size(size))
    if umbrella and has_umbrella(type_id):
        dress = replace(dress, held="umbrella")
    return figure_of(dress, size)


def _mesh(figure: Figure, vertices: Array) -> TriangleMesh:
    return build_mesh(
        vertices, figure.triangles, figure.material, CityObjectLabel.PEDESTRIANS,
        normals=figure.normals(vertices),
    )  # fmt: skip


def walking_joints(type_id: str, extent: Vector, phase: int) -> Pose:
    """Joints of a blueprint's figure in its actor's frame, see :func:`joints_at`.

    Raises:
        ValueError: there is no such phase.
    """
    return joints_at(extent, phase, stoop=stoop_m(type_id), holds=has_umbrella(type_id))
