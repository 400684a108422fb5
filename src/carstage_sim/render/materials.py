"""How each material looks: one table, a row per :class:`carstage_sim.mesh.Material`."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.mesh import Material


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


class Paint(IntEnum):
    """Which of an instance's colours a material takes."""

    BODY = 0
    UPPER = 1
    LOWER = 2
    SKIN = 3
    HAIR = 4


class Look(NamedTuple):
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


LOOKS: dict[Material, Look] = {
    Material.DEFAULT: Look((150, 150, 150)),
    Material.ASPHALT: Look((74, 74, 76), 0.85, 0.03, Detail.ASPHALT),
    Material.LANE_MARKING_WHITE: Look((222, 222, 216), 0.7, 0.04, Detail.MARKING),
    Material.LANE_MARKING_YELLOW: Look((226, 172, 44), 0.7, 0.04, Detail.MARKING),
    Material.SIDEWALK: Look((158, 154, 147), 0.9, 0.03, Detail.PAVING),
    Material.KERB: Look((142, 140, 136), 0.9, 0.03, Detail.GRAIN),
    Material.GRASS: Look((84, 108, 52), 1.0, 0.02, Detail.GRASS),
    Material.SOIL: Look((112, 92, 70), 1.0, 0.02, Detail.GRAIN),
    Material.CONCRETE: Look((156, 154, 150), 0.9, 0.03, Detail.PLASTER),
    Material.BRICK: Look((146, 84, 66), 0.9, 0.03, Detail.BRICK),
    Material.PLASTER: Look((206, 190, 162), 0.95, 0.02, Detail.PLASTER),
    Material.FACADE_WINDOW: Look((40, 48, 58), 0.05, 0.08, Detail.WINDOW, Glow.WINDOW),
    Material.ROOF: Look((96, 92, 92), 0.95, 0.02, Detail.GRAIN),
    Material.METAL: Look((112, 116, 118), 0.45, 0.35),
    Material.WOOD: Look((124, 88, 56), 0.8, 0.03, Detail.BARK),
    Material.BARK: Look((88, 70, 54), 1.0, 0.02, Detail.BARK),
    Material.FOLIAGE: Look((68, 96, 46), 0.9, 0.03, Detail.LEAVES),
    Material.PAINT: Look((160, 24, 28), 0.17, 0.05, paint=Paint.BODY),
    Material.GLASS: Look((14, 17, 20), 0.03, 0.08),
    Material.RUBBER: Look((26, 26, 27), 0.9, 0.02),
    Material.RIM: Look((168, 172, 176), 0.3, 0.5),
    Material.PLASTIC_DARK: Look((30, 30, 32), 0.6, 0.04),
    Material.HEAD_LAMP: Look((206, 212, 218), 0.1, 0.25, glow=Glow.HEAD_LAMP),
    Material.TAIL_LAMP: Look((132, 12, 14), 0.15, 0.08, glow=Glow.TAIL_LAMP),
    Material.BLINKER_LEFT: Look((206, 116, 24), 0.2, 0.06, glow=Glow.BLINKER_LEFT),
    Material.BLINKER_RIGHT: Look((206, 116, 24), 0.2, 0.06, glow=Glow.BLINKER_RIGHT),
    Material.REVERSE_LAMP: Look((210, 210, 210), 0.2, 0.06, glow=Glow.REVERSE_LAMP),
    Material.SKIN: Look((198, 150, 124), 0.8, 0.03, paint=Paint.SKIN),
    Material.CLOTH_UPPER: Look((70, 96, 140), 0.95, 0.02, Detail.CLOTH, paint=Paint.UPPER),
    Material.CLOTH_LOWER: Look((48, 56, 74), 0.95, 0.02, Detail.CLOTH, paint=Paint.LOWER),
    Material.HAIR: Look((48, 34, 26), 0.8, 0.04, paint=Paint.HAIR),
    Material.LIGHT_RED: Look((84, 14, 12), 0.3, 0.05, glow=Glow.LENS_RED),
    Material.LIGHT_YELLOW: Look((96, 68, 8), 0.3, 0.05, glow=Glow.LENS_YELLOW),
    Material.LIGHT_GREEN: Look((10, 70, 42), 0.3, 0.05, glow=Glow.LENS_GREEN),
    Material.STREET_LAMP: Look((228, 226, 214), 0.3, 0.05, glow=Glow.STREET_LAMP),
    Material.SIGN_WHITE: Look((230, 232, 232), 0.5, 0.05),
    Material.SIGN_RED: Look((176, 22, 28), 0.5, 0.05),
    Material.LICENCE_PLATE: Look((224, 224, 218), 0.5, 0.05),
    Material.CROSSWALK_WHITE: Look((218, 218, 212), 0.7, 0.04, Detail.MARKING),
    Material.SHOE: Look((34, 30, 28), 0.8, 0.03),
    Material.PAINT_WHITE: Look((236, 236, 232), 0.17, 0.05),
    Material.PAINT_SILVER: Look((176, 180, 184), 0.17, 0.05),
    Material.PAINT_GREY: Look((92, 96, 100), 0.17, 0.05),
    Material.PAINT_BLACK: Look((18, 18, 20), 0.17, 0.05),
    Material.PAINT_BLUE: Look((30, 56, 112), 0.17, 0.05),
    Material.PAINT_RED: Look((128, 20, 22), 0.17, 0.05),
}


class MaterialTable(NamedTuple):
    """:data:`LOOKS` as arrays; row = material.

    Attributes:
        colour: ``(M, 3)`` float32 linear.
        roughness: ``(M,)`` float32.
        specular: ``(M,)`` float32.
        detail: ``(M,)`` uint8.
        glow: ``(M,)`` uint8.
        paint: ``(M,)`` int8 values of :class:`Paint`, -1 for none.
    """

    colour: NDArray[np.float32]
    roughness: NDArray[np.float32]
    specular: NDArray[np.float32]
    detail: NDArray[np.uint8]
    glow: NDArray[np.uint8]
    paint: NDArray[np.int8]


def material_table() -> MaterialTable:
    """The looks of all materials as arrays."""
    looks = [LOOKS[material] for material in Material]
    return MaterialTable(
        linear_colour(np.array([look.srgb for look in looks], np.uint8)),
        np.array([look.roughness for look in looks], np.float32),
        np.array([look.specular for look in looks], np.float32),
        np.array([look.detail for look in looks], np.uint8),
        np.array([look.glow for look in looks], np.uint8),
        np.array([-1 if look.paint is None else look.paint for look in looks], np.int8),
    )
