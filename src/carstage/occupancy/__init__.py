"""Voxels around the ego or a sensor: what is where, who, how it moves, and who sees it.

Surfaces that LiDARs and cameras see are gathered over an episode: still ones in the world, those
of road users in their boxes. Or the embedded simulator says where surfaces are.
See docs/formats/occupancy.md.
"""

from carstage.occupancy.content import Occupancy, occupancy_name, pack_occupancy, unpack_occupancy
from carstage.occupancy.exact import exact_voxels
from carstage.occupancy.gathering import Gathered
from carstage.occupancy.grid import FREE, VoxelGrid, grid_from_world
from carstage.occupancy.objects import MOVABLE_TAGS, box_tags
from carstage.occupancy.placing import Placer, Voxels
from carstage.occupancy.seeing import Picture, Surface, Sweep, seen_voxels, surface

__all__ = [
    "FREE",
    "MOVABLE_TAGS",
    "Gathered",
    "Occupancy",
    "Picture",
    "Placer",
    "Surface",
    "Sweep",
    "VoxelGrid",
    "Voxels",
    "box_tags",
    "exact_voxels",
    "grid_from_world",
    "occupancy_name",
    "pack_occupancy",
    "seen_voxels",
    "surface",
    "unpack_occupancy",
]
