"""The scene store: the town's geometry, one geometry per actor model, instances of each frame."""

from __future__ import annotations

import hashlib
import logging
import zipfile
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.cache import mark_used, written_atomically
from carstage_sim.maps.street_lamps import street_lamps
from carstage_sim.mesh import Material, TriangleMesh
from carstage_sim.render.bvh import WideTree, build_tree, refitted_tree, triangle_blocks
from carstage_sim.render.cast import Geometry, Scene, empty_geometry
from carstage_sim.render.joined_models import (
    Joined,
    JoinedModels,
    Model,
    Shape,
    Surfaces,
    empty_surfaces,
)
from carstage_sim.render.lamps import Lamps, headlight_beams, lamps_of, lamps_switched
from carstage_sim.render.materials import Paint, cells_of_materials, linear_colour
from carstage_sim.render.object_appearance import (
    HiddenTriangles,
    ObjectAppearance,
    object_appearance,
)
from carstage_sim.render.thrown_light import ThrownLight
from carstage_sim.render.vector_code import LANES
from carstage_sim.world.town_changes import TownChanges

PAINTS = len(Paint)
"""Colours that an instance brings along."""

PASSING = "@"
"""A model whose key has this mark is given up as soon as no frame shows it."""

_MOST_PAST = 2
"""The arrays are made anew without what was given up once they have so many times the triangles of
what is kept: that takes long."""

QUICK = "~"
"""A model whose key has this mark is made as quickly as a stored one is read: it is not stored."""

_NUMBERS = np.arange(256)
_IS_PANE = np.isin(_NUMBERS, (Material.FACADE_WINDOW, Material.SHOP_WINDOW, Material.HOUSE_DOOR))
_IS_WALL = np.isin(_NUMBERS, (Material.PLASTER, Material.CONCRETE))
_WIDEST_PANE = 127

_log = logging.getLogger(__name__)


class Placement(NamedTuple):
    """One actor that can be seen in a frame.

    Attributes:
        actor_id: the actor's id.
        model: key of its mesh.
        location: world metres.
        rotation: ``(3, 3)`` world_from_actor.
        colours: sRGB colours, one for each :class:`carstage_sim.render.materials.Paint`.
        light_state: the actor's light bits as in ``WorldState``.
    """

    actor_id: int
    model: str
    location: NDArray[np.float64]
    rotation: NDArray[np.float64]
    colours: tuple[tuple[int, int, int], ...] = ((128, 128, 128),) * PAINTS
    light_state: int = 0


@dataclass(frozen=True, slots=True)
class Frame:
    """The scene of one tick, with the look-up tables that belong to its hits.

    Attributes:
        scene: what rays meet.
        static, actors: surfaces of the two geometries.
        appearance: what clients changed about the town's objects.
        actor_id: ``(I,)`` uint32 per instance row.
        colour: ``(I, PAINTS, 3)`` float32 linear colours per instance row.
        light_state: ``(I,)`` uint32 per instance row.
        bounds: ``(I, 2, 3)`` float32 box of each row's mesh in the actor's frame.
        location: ``(I, 3)`` float64 world metres of each row.
        rotation: ``(I, 3, 3)`` float64 world_from_actor of each row.
        shapes: of each instance row.
        lamps: lamps that light their surroundings.
    """

    scene: Scene
    static: Surfaces
    actors: Surfaces
    appearance: ObjectAppearance
    actor_id: NDArray[np.uint32]
    colour: NDArray[np.float32]
    light_state: NDArray[np.uint32]
    bounds: NDArray[np.float32]
    location: NDArray[np.float64]
    rotation: NDArray[np.float64]
    shapes: Sequence[Shape]
    lamps: Lamps

    @property
    def body(self) -> NDArray[np.intp]:
        """``(I,)`` the first row of each row's actor; others are parts that move by themselves."""
        _, first, number = np.unique(self.actor_id, return_index=True, return_inverse=True)
        return np.asarray(first[number])

    def row_around(self, actor_id: int, point: NDArray[np.float64]) -> int:
        """Row of ``actor_id`` if the world ``point`` lies in its mesh's box, else -1.

        A sensor inside the body that carries it must not see the body from within.
        """
        (rows,) = np.nonzero(self.actor_id == actor_id)
        for row in rows:
            offset = np.asarray(point, np.float32) - self.scene.position[row]
            local = offset @ self.scene.rotation[row]
            if np.all(local >= self.bounds[row, 0]) and np.all(local <= self.bounds[row, 1]):
                return int(row)
        return -1

    def without(self, actor_ids: frozenset[int]) -> Frame:
        """The same frame, but rays pass through some actors."""
        gone = np.isin(self.actor_id, np.fromiter(actor_ids, np.uint32, len(actor_ids)))
        return replace(self, scene=self._of_rows(self._left(~gone))) if gone.any() else self

    def only(self, wanted: NDArray[np.bool_]) -> Scene:
        """The scene of some instances without the town; the rows keep their numbers.

        Args:
            wanted: ``(I,)``; rays pass through the others, and through whom they did before.
        """
        return self._of_rows(self._left(wanted))._replace(static=empty_geometry())

    def _left(self, wanted: NDArray[np.bool_]) -> NDArray[np.int32]:
        """Wanted rows of those that rays meet, ascending."""
        rows = np.sort(self.scene.top_row)
        return rows[wanted[rows]]

    def moved(self, rotation: NDArray[np.float32], position: NDArray[np.float32]) -> Scene:
        """The scene with its instances elsewhere; the rows keep their numbers and shapes.

        Args:
            rotation: ``(I, 3, 3)`` world from each row's own axes.
            position: ``(I, 3)`` world metres.
        """
        elsewhere = replace(self, scene=self.scene._replace(rotation=rotation, position=position))
        return elsewhere._of_rows(np.sort(self.scene.top_row))

    def with_larger_boxes(self, spare_m: NDArray[np.float32]) -> Scene:
        """The scene where instances may be elsewhere than they are, without a new hierarchy.

        Args:
            spare_m: ``(I,)`` float32 how far each one's points may move.
        """
        return self._of_rows(np.sort(self.scene.top_row), spare_m)

    def _of_rows(
        self, rows: NDArray[np.int32], spare_m: NDArray[np.float32] | None = None
    ) -> Scene:
        scene = self.scene
        spare_m = None if spare_m is None else spare_m[rows]
        top = top_tree(scene.rotation[rows], scene.position[rows], self.bounds[rows], spare_m)
        return scene._replace(
            top_planes=top.planes,
            top_children=top.children,
            top_row=rows[top.order[top.leaf_first]].astype(np.int32),
        )


def _corners(mesh: TriangleMesh) -> NDArray[np.float32]:
    corners: NDArray[np.float32] = mesh.vertices[mesh.triangles]
    return corners


def _boxes(corners: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """``(T, 3)`` lowest and highest of ``(T, 3, 3)`` corners; numpy's own minima take longer."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _tree(corners: NDArray[np.float32]) -> WideTree:
    return build_tree(*_boxes(corners), LANES)


def _flat_normals(corners: NDArray[np.float32]) -> NDArray[np.float32]:
    wide = corners.astype(np.float64).transpose(1, 2, 0)  # by axis: twice as fast as np.cross
    (ax, ay, az), (bx, by, bz) = wide[1] - wide[0], wide[2] - wide[0]
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = np.maximum(np.sqrt(x * x + y * y + z * z), 1e-15)
    return np.stack([x / length, y / length, z / length], axis=1).astype(np.float32)


def _panes(mesh: TriangleMesh) -> NDArray[np.uint16]:
    """Pairs of pane triangles ``(0, 1, 2), (0, 2, 3)`` that follow each other, and their size.

    Rectangles of upright walls are told of, too.
    """
    half = np.zeros(len(mesh.triangles), np.uint16)
    index = mesh.triangles
    glazed = _IS_PANE[mesh.material]
    walls = np.flatnonzero(_IS_WALL[mesh.material])
    if not len(walls) and not glazed.any():
        return half
    corners = mesh.vertices[index[walls], 2]
    # The first two corners of an upright rectangle's first half are as high as each other, the last
    # two of its second half.
    glazed[walls] = ((corners[:, 0] == corners[:, 1]) | (corners[:, 1] == corners[:, 2])) & (
        np.ptp(corners, axis=1) > 0
    )
    candidates = np.flatnonzero(glazed[:-1] & glazed[1:])
    first, second = mesh.vertices[index[candidates]], mesh.vertices[index[candidates + 1]]
    pair = (first[:, 0] == second[:, 0]).all(axis=1) & (first[:, 2] == second[:, 1]).all(axis=1)
    begins = candidates[pair]
    sides = np.linalg.norm(first[pair][:, 1:] - first[pair][:, [0, 1]], axis=2)
    wide, high = np.minimum(np.rint(sides * 10.0), _WIDEST_PANE).astype(np.uint16).T
    half[begins] = 1 + 4 * wide + 512 * high
    half[begins + 1] = 2 + 4 * wide + 512 * high
    return half


def _surfaces(mesh: TriangleMesh, corners: NDArray[np.float32]) -> Surfaces:
    # Kernels are compiled for writable arrays; a mesh from a mapped file has none.
    return Surfaces(
        np.require(mesh.normals, np.float32, ["C", "W"]),
        np.require(mesh.material, np.uint8, ["C", "W"]),
        np.require(mesh.tag, np.uint8, ["C", "W"]),
        np.require(mesh.object_id, np.uint32, ["C", "W"]),
        _flat_normals(corners),
        _panes(mesh),
    )


def _cells(mesh: TriangleMesh, numbers: NDArray[np.int32]) -> NDArray[np.uint8]:
    """Cells of leaves of the triangles of each leaf block, 0 where there are no gaps."""
    cells = cells_of_materials()[mesh.material]
    return np.where(numbers >= 0, cells[numbers], np.uint8(0))


def _model(mesh: TriangleMesh, tree: WideTree | None = None) -> Model:
    corners = _corners(mesh)
    if tree is None:
        tree = _tree(corners)
    blocks, numbers = triangle_blocks(tree, corners)
    return Model(
        Geometry(tree.planes, tree.children, blocks, numbers, _cells(mesh, numbers)),
        _surfaces(mesh, corners),
        mesh.bounds,
        corners,
    )


def cached_tree(mesh: TriangleMesh, folder: Path) -> WideTree:
    """The hierarchy over a mesh's triangles, from ``folder`` when its content was seen before.

    The file's name is a hash of the geometry; it is written under another name and renamed, so a
    reader never meets half a file. A file that cannot be read is built again.
    """
    corners = np.ascontiguousarray(_corners(mesh))
    source = Path(__file__).with_name("bvh.py").read_bytes()
    digest = hashlib.sha256(corners.tobytes() + source).hexdigest()[:24]
    path = folder / f"{digest}.npz"
    mark_used(path)
    try:
        # np.load given a path would leave a file open that is no archive.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            return WideTree(*(stored[name] for name in WideTree.__dataclass_fields__))
    except FileNotFoundError:
        pass
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        _log.warning("acceleration structure %s is unreadable, building it again: %s", path, error)
    tree = _tree(corners)
    arrays = {name: getattr(tree, name) for name in WideTree.__dataclass_fields__}
    try:
        with written_atomically(path) as draft:
            np.savez(draft, allow_pickle=False, **arrays)
    except OSError as error:
        _log.warning("acceleration structure not kept in %s: %s", folder, error)
    return tree


class SceneStore:
    """Keeps geometries between frames and puts instances of them into a scene.

    Args:
        static: the town's mesh, or None for an empty world.
        mesh_of: gives the mesh of a model key; called once per key.
        cache: folder of stored hierarchies; None stores none.
        beside: gives the keys of models that are soon needed when one is; they are built with it.
    """

    def __init__(
        self,
        static: TriangleMesh | None,
        mesh_of: Callable[[str], TriangleMesh],
        *,
        cache: Path | None,
        beside: Callable[[str], Sequence[str]] = lambda key: (),
    ) -> None:
        self._mesh_of = mesh_of
        self._beside = beside
        self._cache = cache
        self._models: dict[str, Joined] = {}
        self._joined = JoinedModels()
        self._street_lamps = street_lamps(static)
        self._lamps = lamps_of(self._street_lamps)
        if static is None or not len(static.triangles):
            self._static, self._static_surfaces = empty_geometry(), empty_surfaces()
        else:
            model = _model(static, cached_tree(static, cache) if cache is not None else None)
            self._static, self._static_surfaces = model.geometry, model.surfaces
        owners = self._static_surfaces.object_id
        self._hidden_triangles = HiddenTriangles(self._static, owners)
        self._object_count = int(owners.max(initial=0))
        self._colours: list[tuple[tuple[int, int, int], ...]] = []
        self._linear_colours = np.empty((0, PAINTS, 3), np.float32)
        self._town_changes: TownChanges | None = None
        self.show(TownChanges())

    def shows(self, changes: TownChanges | None) -> bool:
        """Whether a frame with these changes leaves the town as it is shown."""
        return changes is None or changes is self._town_changes

    def show(self, changes: TownChanges) -> None:
        """Show the town as clients changed it, also in frames that were made before."""
        if changes is self._town_changes:
            return
        self._town_changes = changes
        self._static = self._hidden_triangles.hide(changes.hidden)
        self._appearance = object_appearance(self._object_count, self._street_lamps, changes)
        power = np.zeros((len(self._street_lamps), 3), np.float32)
        if len(changes.lamp_power):
            gone = np.isin(self._street_lamps.object_id, list(changes.hidden))
            power = np.where(gone[:, None], np.float32(0), changes.lamp_power)
        if not np.array_equal(power, self._lamps.power):
            self._lamps = lamps_switched(self._lamps, power, self._thrown_light)

    @cached_property
    def _thrown_light(self) -> ThrownLight:
        return ThrownLight(self._street_lamps.location)

    def prepare(self, keys: Sequence[str]) -> None:
        """Build models now, so that the first frame that shows them need not."""
        for first in dict.fromkeys(keys):
            if first not in self._models:
                group = dict.fromkeys((first, *self._beside(first)))
                self._build([key for key in group if key not in self._models])

    def _build(self, keys: list[str]) -> None:
        """Build models that are needed together."""
        meshes = {key: self._mesh_of(key) for key in keys}
        # Poses of one figure: a hierarchy that suits the one in the middle suits them all.
        posed = [mesh for key, mesh in meshes.items() if QUICK in key]
        middle = _tree(_corners(posed[len(posed) // 2])) if posed else None
        for key, mesh in meshes.items():
            tree = None
            if QUICK in key and middle is not None and len(mesh.triangles) == len(middle.order):
                tree = refitted_tree(middle, *_boxes(_corners(mesh)))
            elif PASSING not in key and QUICK not in key and self._cache is not None:
                tree = cached_tree(mesh, self._cache)
            self._models[key] = self._joined.add(_model(mesh, tree))

    def _forget_passing(self, wanted: Container[str]) -> None:
        """Give up the models of one moment that are not wanted any more."""
        past = [key for key in self._models if PASSING in key and key not in wanted]
        for key in past:
            del self._models[key]
        if past:
            kept = sum(len(joined.shape.corners) for joined in self._models.values())
            if self._joined.triangles > _MOST_PAST * kept:
                before, self._joined = self._joined, JoinedModels()
                for key, joined in self._models.items():
                    self._models[key] = self._joined.add(before.model(joined))

    def frame(self, placements: Sequence[Placement], changes: TownChanges | None = None) -> Frame:
        """The scene with ``placements`` in it; instance row = place in the sequence.

        Args:
            placements: the actors that can be seen.
            changes: what clients changed about the town; None leaves it as it was.
        """
        if changes is not None:
            self.show(changes)
        wanted = dict.fromkeys(p.model for p in placements)
        self._forget_passing(wanted)
        self.prepare(list(wanted))
        actors, surfaces = self._joined.arrays()
        models = [self._models[p.model] for p in placements]
        exact_rotation = np.array([p.rotation for p in placements], np.float64).reshape(-1, 3, 3)
        exact_location = np.array([p.location for p in placements], np.float64).reshape(-1, 3)
        rotation, position = exact_rotation.astype(np.float32), exact_location.astype(np.float32)
        bounds = _stacked([model.bounds for model in models], (2, 3))
        top = top_tree(rotation, position, bounds)
        light_state = np.array([p.light_state & 0xFFFFFFFF for p in placements], np.uint32)
        beams = headlight_beams(rotation, position, bounds, light_state)
        return Frame(
            scene=Scene(
                static=self._static,
                actors=actors,
                top_planes=top.planes,
                top_children=top.children,
                top_row=top.order[top.leaf_first],
                rotation=rotation,
                position=position,
                root=np.array([model.root for model in models], np.int32),
            ),
            static=self._static_surfaces,
            actors=surfaces,
            appearance=self._appearance,
            actor_id=np.array([p.actor_id for p in placements], np.uint32),
            colour=self._linear([p.colours for p in placements]),
            light_state=light_state,
            bounds=bounds,
            location=exact_location,
            rotation=exact_rotation,
            shapes=[model.shape for model in models],
            lamps=self._lamps._replace(beams=beams),
        )

    def _linear(self, colours: list[tuple[tuple[int, int, int], ...]]) -> NDArray[np.float32]:
        """``(N, PAINTS, 3)`` linear colours; the same array again while nobody comes or goes."""
        if colours != self._colours:
            codes = np.array(colours, np.uint8).reshape(len(colours), PAINTS, 3)
            self._colours, self._linear_colours = colours, linear_colour(codes)
        return self._linear_colours


def _stacked(rows: Sequence[NDArray[np.floating]], shape: tuple[int, ...]) -> NDArray[np.float32]:
    """``(N, *shape)`` float32 of ``N`` arrays, which may be none."""
    return np.array(rows, np.float32).reshape(len(rows), *shape)


def top_tree(
    rotation: NDArray[np.float32],
    position: NDArray[np.float32],
    bounds: NDArray[np.float32],
    spare_m: NDArray[np.float32] | None = None,
) -> WideTree:
    """Hierarchy over the instances' world boxes, a leaf for each.

    Args:
        rotation, position: of the instances, as in :class:`carstage_sim.render.cast.Scene`.
        bounds: ``(I, 2, 3)`` float32 of each one's mesh, in its own axes.
        spare_m: ``(I,)`` float32 by how much boxes are larger on all sides; None: not at all.
    """
    if not len(position):
        return WideTree(
            np.empty((0, 6, LANES), np.float32),
            np.empty((0, LANES), np.int32),
            np.empty(0, np.int32),
            np.empty(0, np.int32),
            np.empty(0, np.int32),
        )
    centre = (bounds[:, 0] + bounds[:, 1]) / 2
    half = (bounds[:, 1] - bounds[:, 0]) / 2
    middle = np.einsum("nij,nj->ni", rotation, centre) + position
    # A millimetre covers the rounding of rays that are moved into the actor's frame.
    reach = np.einsum("nij,nj->ni", np.abs(rotation), half) + np.float32(1e-3)
    if spare_m is not None:
        reach = reach + spare_m[:, None]
    return build_tree(middle - reach, middle + reach, 1)
