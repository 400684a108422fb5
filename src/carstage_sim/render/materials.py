"""How each material looks: one table, a row per :class:`carstage_sim.mesh.Material`."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.mesh import LEAF_CELLS, Material


def linear_colour(srgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Linear light of 8-bit sRGB values (IEC 61966-2-1), float32 in 0-1."""
    value = srgb.astype(np.float64) / 255.0
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return linear.astype(np.float32)


class Detail(IntEnum):
    """Which procedural pattern varies a material's colour."""

    NONE = 0
    GRAIN = 1
    ASPHALT = 2
    PAVING = 3
    BRICK = 4
    GRASS = 5
    LEAVES = 6
    MARKING = 7
    WINDOW = 8
    PLASTER = 9
    CLOTH = 10
    BARK = 11
    GLAZING = 12
    PICTURE = 13
    SHOP = 14
    DOOR = 15
    ROOM = 16
    KERB = 17
    GUTTER = 18
    TACTILE = 19
    COVER = 20


class Glow(IntEnum):
    """What makes a material emit light."""

    NONE = 0
    HEAD_LAMP = 1
    TAIL_LAMP = 2
    BLINKER_LEFT = 3
    BLINKER_RIGHT = 4
    REVERSE_LAMP = 5
    LENS_RED = 6
    LENS_YELLOW = 7
    LENS_GREEN = 8
    STREET_LAMP = 9
    WINDOW = 10
    BRAKE_LAMP = 11
    BEACON_BLUE = 12
    BEACON_RED = 13
    DISPLAY = 14


class Paint(IntEnum):
    """Which of an instance's colours a material takes."""

    BODY = 0
    UPPER = 1
    LOWER = 2
    SKIN = 3
    HAIR = 4
    ACCENT = 5
    SHOES = 6
    BAG = 7


class MaterialAppearance(NamedTuple):
    """One material.

    Attributes:
        srgb: base colour; an instance's may replace it.
        roughness: 0 is a mirror, 1 is chalk.
        specular: reflectance at normal incidence.
        detail: procedural pattern.
        glow: source of emitted light.
        paint: slot of the instance's colours that replaces the base colour, None for none.
    """

    srgb: tuple[int, int, int]
    roughness: float = 0.9
    specular: float = 0.02
    detail: Detail = Detail.NONE
    glow: Glow = Glow.NONE
    paint: Paint | None = None


APPEARANCES: dict[Material, MaterialAppearance] = {
    Material.DEFAULT: MaterialAppearance((150, 150, 150)),
    Material.ASPHALT: MaterialAppearance((88, 86, 84), 0.85, 0.03, Detail.ASPHALT),
    Material.LANE_MARKING_WHITE: MaterialAppearance((222, 222, 216), 0.7, 0.04, Detail.MARKING),
    Material.LANE_MARKING_YELLOW: MaterialAppearance((226, 172, 44), 0.7, 0.04, Detail.MARKING),
    Material.SIDEWALK: MaterialAppearance((158, 154, 147), 0.9, 0.03, Detail.PAVING),
    Material.KERB: MaterialAppearance((138, 135, 130), 0.9, 0.03, Detail.KERB),
    Material.GRASS: MaterialAppearance((84, 108, 52), 1.0, 0.02, Detail.GRASS),
    Material.SOIL: MaterialAppearance((112, 92, 70), 1.0, 0.02, Detail.GRAIN),
    Material.CONCRETE: MaterialAppearance((156, 154, 150), 0.9, 0.03, Detail.PLASTER),
    Material.BRICK: MaterialAppearance((146, 84, 66), 0.9, 0.03, Detail.BRICK),
    Material.PLASTER: MaterialAppearance((206, 190, 162), 0.95, 0.02, Detail.PLASTER),
    Material.FACADE_WINDOW: MaterialAppearance(
        (40, 48, 58), 0.05, 0.08, Detail.WINDOW, Glow.WINDOW
    ),
    Material.ROOF: MaterialAppearance((96, 92, 92), 0.95, 0.02, Detail.GRAIN),
    Material.METAL: MaterialAppearance((112, 116, 118), 0.45, 0.35),
    Material.WOOD: MaterialAppearance((124, 88, 56), 0.8, 0.03, Detail.BARK),
    Material.BARK: MaterialAppearance((88, 76, 62), 1.0, 0.02, Detail.BARK),
    Material.FOLIAGE: MaterialAppearance((52, 76, 36), 0.9, 0.03, Detail.LEAVES),
    Material.PAINT: MaterialAppearance((160, 24, 28), 0.08, 0.05, paint=Paint.BODY),
    Material.GLASS: MaterialAppearance((14, 17, 20), 0.03, 0.08, Detail.GLAZING),
    Material.RUBBER: MaterialAppearance((26, 26, 27), 0.9, 0.02),
    Material.RIM: MaterialAppearance((168, 172, 176), 0.3, 0.5),
    Material.PLASTIC_DARK: MaterialAppearance((30, 30, 32), 0.6, 0.04, Detail.GRAIN),
    Material.HEAD_LAMP: MaterialAppearance((206, 212, 218), 0.1, 0.25, glow=Glow.HEAD_LAMP),
    Material.TAIL_LAMP: MaterialAppearance((132, 12, 14), 0.15, 0.04, glow=Glow.TAIL_LAMP),
    Material.BLINKER_LEFT: MaterialAppearance((164, 80, 22), 0.2, 0.04, glow=Glow.BLINKER_LEFT),
    Material.BLINKER_RIGHT: MaterialAppearance((164, 80, 22), 0.2, 0.04, glow=Glow.BLINKER_RIGHT),
    Material.REVERSE_LAMP: MaterialAppearance((158, 154, 154), 0.2, 0.06, glow=Glow.REVERSE_LAMP),
    Material.SKIN: MaterialAppearance((198, 150, 124), 0.8, 0.03, paint=Paint.SKIN),
    Material.CLOTH_UPPER: MaterialAppearance(
        (70, 96, 140), 0.95, 0.02, Detail.CLOTH, paint=Paint.UPPER
    ),
    Material.CLOTH_LOWER: MaterialAppearance(
        (48, 56, 74), 0.95, 0.02, Detail.CLOTH, paint=Paint.LOWER
    ),
    Material.HAIR: MaterialAppearance((48, 34, 26), 0.8, 0.04, paint=Paint.HAIR),
    Material.LIGHT_RED: MaterialAppearance((84, 14, 12), 0.3, 0.05, glow=Glow.LENS_RED),
    Material.LIGHT_YELLOW: MaterialAppearance((96, 68, 8), 0.3, 0.05, glow=Glow.LENS_YELLOW),
    Material.LIGHT_GREEN: MaterialAppearance((10, 70, 42), 0.3, 0.05, glow=Glow.LENS_GREEN),
    Material.STREET_LAMP: MaterialAppearance((228, 226, 214), 0.3, 0.05, glow=Glow.STREET_LAMP),
    Material.SIGN_WHITE: MaterialAppearance((230, 232, 232), 0.5, 0.05),
    Material.SIGN_RED: MaterialAppearance((176, 22, 28), 0.5, 0.05),
    Material.LICENCE_PLATE: MaterialAppearance((224, 224, 218), 0.5, 0.05),
    Material.CROSSWALK_WHITE: MaterialAppearance((218, 218, 212), 0.7, 0.04, Detail.MARKING),
    Material.SHOE: MaterialAppearance((34, 30, 28), 0.7, 0.03, paint=Paint.SHOES),
    Material.PAINT_WHITE: MaterialAppearance((236, 236, 232), 0.08, 0.05),
    Material.PAINT_SILVER: MaterialAppearance((176, 180, 184), 0.08, 0.05),
    Material.PAINT_GREY: MaterialAppearance((92, 96, 100), 0.08, 0.05),
    Material.PAINT_BLACK: MaterialAppearance((18, 18, 20), 0.08, 0.05),
    Material.PAINT_BLUE: MaterialAppearance((30, 56, 112), 0.08, 0.05),
    Material.PAINT_RED: MaterialAppearance((128, 20, 22), 0.08, 0.05),
    Material.LAMP_COVER: MaterialAppearance((104, 110, 116), 0.05, 0.20),
    Material.BRAKE_LAMP: MaterialAppearance((112, 8, 10), 0.15, 0.04, glow=Glow.BRAKE_LAMP),
    Material.BEACON_BLUE: MaterialAppearance((20, 48, 168), 0.12, 0.04, glow=Glow.BEACON_BLUE),
    Material.BEACON_RED: MaterialAppearance((168, 16, 18), 0.12, 0.04, glow=Glow.BEACON_RED),
    Material.SEAT: MaterialAppearance((98, 94, 90), 0.9, 0.02),
    Material.SIGN_BLUE: MaterialAppearance((24, 62, 150), 0.5, 0.05),
    Material.SIGN_YELLOW: MaterialAppearance((222, 226, 40), 0.5, 0.05),
    Material.DISPLAY: MaterialAppearance((214, 128, 20), 0.6, 0.02, glow=Glow.DISPLAY),
    Material.GLASS_DARK: MaterialAppearance((14, 17, 20), 0.03, 0.08),
    Material.GLASS_TINTED: MaterialAppearance((14, 17, 20), 0.03, 0.08, Detail.GLAZING),
    Material.CLOTH_ACCENT: MaterialAppearance(
        (186, 186, 182), 0.95, 0.02, Detail.CLOTH, paint=Paint.ACCENT
    ),
    Material.BAG: MaterialAppearance((58, 44, 36), 0.7, 0.03, paint=Paint.BAG),
    Material.LIPS: MaterialAppearance((142, 78, 70), 0.6, 0.04),
    Material.SOLE: MaterialAppearance((58, 54, 50), 0.9, 0.02),
    Material.LEAVES: MaterialAppearance((76, 104, 46), 0.9, 0.03, Detail.LEAVES),
    Material.LEAVES_LIGHT: MaterialAppearance((104, 126, 52), 0.9, 0.03, Detail.LEAVES),
    Material.LEAVES_DARK: MaterialAppearance((56, 82, 42), 0.9, 0.03, Detail.LEAVES),
    Material.LEAVES_SMALL: MaterialAppearance((88, 112, 54), 0.9, 0.03, Detail.LEAVES),
    Material.LEAVES_YELLOW: MaterialAppearance((186, 150, 46), 0.9, 0.03, Detail.LEAVES),
    Material.LEAVES_RED: MaterialAppearance((150, 82, 40), 0.9, 0.03, Detail.LEAVES),
    Material.NEEDLES: MaterialAppearance((48, 74, 50), 0.9, 0.03, Detail.LEAVES),
    Material.BLADES: MaterialAppearance((94, 118, 54), 0.9, 0.02, Detail.LEAVES),
    Material.BARK_PALE: MaterialAppearance((176, 172, 162), 1.0, 0.02, Detail.BARK),
    Material.WOODS: MaterialAppearance((86, 104, 82), 1.0, 0.02, Detail.GRASS),
    Material.SHOP_WINDOW: MaterialAppearance((40, 48, 58), 0.05, 0.08, Detail.SHOP, Glow.WINDOW),
    Material.HOUSE_DOOR: MaterialAppearance((84, 60, 44), 0.6, 0.04, Detail.DOOR),
    Material.GUTTER: MaterialAppearance((118, 116, 112), 0.9, 0.03, Detail.GUTTER),
    Material.TACTILE: MaterialAppearance((186, 178, 152), 0.9, 0.03, Detail.TACTILE),
    Material.TAR: MaterialAppearance((39, 38, 37), 0.85, 0.03, Detail.GRAIN),
    Material.ASPHALT_NEW: MaterialAppearance((59, 58, 57), 0.85, 0.03, Detail.ASPHALT),
    Material.COVER: MaterialAppearance((64, 60, 56), 0.8, 0.04, Detail.COVER),
    Material.PICTURE: MaterialAppearance((128, 128, 128), 0.9, 0.02, Detail.PICTURE),
}


class MaterialTable(NamedTuple):
    """:data:`APPEARANCES` as arrays; row = material.

    Attributes:
        colour: ``(M, 3)`` float32 linear.
        roughness: ``(M,)`` float32.
        specular: ``(M,)`` float32.
        detail: ``(M,)`` uint8.
        glow: ``(M,)`` uint8.
        paint: ``(M,)`` int8 values of :class:`Paint`, -1 for none.
        cells: ``(M,)`` uint8 of cards of leaves; see
            :func:`carstage_sim.render.materials.cells_of_materials`.
    """

    colour: NDArray[np.float32]
    roughness: NDArray[np.float32]
    specular: NDArray[np.float32]
    detail: NDArray[np.uint8]
    glow: NDArray[np.uint8]
    paint: NDArray[np.int8]
    cells: NDArray[np.uint8]


def cells_of_materials() -> NDArray[np.uint8]:
    """``(M,)`` uint8 of each material: 16 times the leaves along a card's second side, and those
    along its first; 0 is a material without gaps.
    """
    packed = np.zeros(len(Material), np.uint8)
    for material, (first, second) in LEAF_CELLS.items():
        packed[material] = second * 16 + first
    return packed


def material_table() -> MaterialTable:
    """The appearance of all materials as arrays."""
    appearances = [APPEARANCES[material] for material in Material]
    return MaterialTable(
        linear_colour(np.array([one.srgb for one in appearances], np.uint8)),
        np.array([one.roughness for one in appearances], np.float32),
        np.array([one.specular for one in appearances], np.float32),
        np.array([one.detail for one in appearances], np.uint8),
        np.array([one.glow for one in appearances], np.uint8),
        np.array([-1 if one.paint is None else one.paint for one in appearances], np.int8),
        cells_of_materials(),
    )
