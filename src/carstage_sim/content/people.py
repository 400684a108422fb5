"""Who the pedestrians are: sex and age of each blueprint, build, hair and clothes."""

from __future__ import annotations

import hashlib
from functools import cache

from carstage_sim.content.figures import Dress
from carstage_sim.mesh import Material

Colour = tuple[int, int, int]

COUNT = 50
SMALL_CHILDREN = (9, 10, 11, 48, 49)
CHILDREN = (12, 13, 14)
POLICE = (30, 32)
ELDERLY = (20, 27, 34, 42, 46)
WALKING_ONLY = (*SMALL_CHILDREN, *CHILDREN, *POLICE, 42, 43, 44, 50)
"""Who cannot use a wheelchair: CARLA 0.9.16 has one for most, not for children and police."""
FEMALE = (1, 5, 6, 7, 8, 9, 10, 11, 15, 19, 20, 22, 23, 24, 25, 31, 33, 35, 36, 37, 40, 41, 48)

_BAG = Material.BAG
_MEN = (
    Dress(top="jacket", hair="short", held="phone"),
    Dress(top="tee", pattern="print", bottom="shorts", hair="cap", width=1.02),
    Dress(top="shirt", pattern="stripes", hair="fade", bag="rucksack", width=0.96),
    Dress(top="coat", hair="beanie", width=1.04, held="cup"),
    Dress(top="shirt", pattern="raglan", hair="bald", belly=0.05, width=1.10, bag="shopping"),
    Dress(top="tee", hair="curly", pattern="block", width=0.98, held="phone"),
    Dress(top="shirt", pattern="vest", hair="helmet", width=1.05),
)
_WOMEN = (
    Dress(female=True, top="jacket", hair="long", bag="shoulder"),
    Dress(female=True, top="dress", bottom="skirt", hair="bun", bag="hand"),
    Dress(female=True, top="tee", bottom="leggings", hair="ponytail", pattern="block"),
    Dress(
        female=True,
        top="coat",
        bottom="trousers",
        hair="bob",
        bag="shoulder",
        width=1.04,
        held="cup",
    ),
    Dress(female=True, top="shirt", bottom="long skirt", hair="scarf", width=1.05, held="phone"),
    Dress(
        female=True,
        top="tee",
        pattern="stripes",
        hair="long",
        bag="rucksack",
        width=0.97,
        held="phone",
    ),
    Dress(
        female=True,
        top="shirt",
        bottom="skirt",
        hair="sun hat",
        width=1.12,
        belly=0.02,
        bag="shopping",
    ),
)
_BOYS = (
    Dress(top="tee", pattern="stripes", bottom="shorts", hair="short", bag="rucksack", width=0.94),
    Dress(top="shirt", pattern="print", hair="cap", width=0.96),
)
_GIRLS = (
    Dress(top="dress", bottom="skirt", hair="ponytail", width=0.94),
    Dress(top="tee", pattern="block", bottom="leggings", hair="long", bag="rucksack", width=0.92),
)
_OLD_MAN = Dress(top="jacket", hair="hat", belly=0.03, width=1.02)
_OLD_WOMAN = Dress(female=True, top="coat", bottom="long skirt", hair="bun", bag="hand", width=1.05)
_OFFICER = Dress(top="jacket", hair="cap", width=1.03)

_UPPERS: tuple[Colour, ...] = (
    (44, 62, 96), (150, 42, 40), (206, 202, 192), (58, 60, 62), (60, 98, 72), (176, 136, 70),
    (104, 70, 110), (74, 128, 160), (190, 110, 84), (30, 32, 38), (128, 132, 136), (212, 170, 60),
    (92, 40, 52), (226, 224, 218), (96, 104, 74), (34, 92, 110), (198, 150, 158), (70, 54, 44),
)  # fmt: skip
_ACCENTS: tuple[Colour, ...] = (
    (226, 224, 218), (40, 44, 54), (186, 186, 182), (206, 178, 140), (120, 150, 184), (150, 56, 52),
    (224, 206, 150), (64, 74, 66),
)  # fmt: skip
_LOWERS: tuple[Colour, ...] = (
    (42, 52, 78), (36, 36, 40), (112, 98, 78), (72, 76, 82), (28, 34, 52), (92, 70, 54),
    (62, 80, 112), (136, 128, 112), (88, 98, 80), (46, 40, 44),
)  # fmt: skip
_SKINS: tuple[Colour, ...] = (
    (230, 190, 166), (222, 178, 150), (208, 160, 130), (192, 144, 114), (168, 120, 90),
    (138, 96, 70), (110, 76, 56), (88, 60, 46),
)  # fmt: skip
_HAIRS: tuple[Colour, ...] = (
    (40, 28, 22), (24, 20, 18), (92, 62, 38), (150, 116, 70), (112, 58, 34), (58, 42, 32),
)  # fmt: skip
_GREYS: tuple[Colour, ...] = ((196, 194, 190), (148, 146, 144), (172, 168, 160))
_SHOES: tuple[Colour, ...] = (
    (34, 30, 28), (222, 222, 218), (96, 62, 40), (52, 56, 66), (128, 36, 36), (70, 66, 60),
)  # fmt: skip
_BAGS: tuple[Colour, ...] = (
    (58, 44, 36), (34, 36, 42), (128, 46, 44), (62, 84, 72), (168, 132, 88), (46, 66, 104),
)  # fmt: skip


def _number(type_id: str) -> int:
    """Number of a pedestrian; 0 of who has none."""
    tail = type_id.rpartition(".")[2]
    return int(tail) if tail.isdecimal() else 0


def stoop_m(type_id: str) -> float:
    """How far one is bent forward, metres of a figure of 1.8 m."""
    return 0.06 if _number(type_id) in ELDERLY else 0.0


def has_umbrella(type_id: str) -> bool:
    """Whether one opens an umbrella when it rains: those whose right hand holds something."""
    return dress_of(type_id).held != "nothing"


@cache
def dress_of(type_id: str) -> Dress:
    """Build, hair and clothes of a blueprint; those of one dress differ in their colours."""
    number = _number(type_id)
    female = number in FEMALE
    if number in POLICE:
        return _OFFICER
    if number in ELDERLY:
        return _OLD_WOMAN if female else _OLD_MAN
    young = number in SMALL_CHILDREN or number in CHILDREN
    kinds = (_GIRLS if female else _BOYS) if young else (_WOMEN if female else _MEN)
    # In turn, so that all kinds are met.
    alike = [n for n in range(COUNT + 1) if (n in FEMALE) == female and _is_young(n) == young]
    return kinds[alike.index(number) % len(kinds)] if number in alike else kinds[0]


def _is_young(number: int) -> bool:
    return number in SMALL_CHILDREN or number in CHILDREN


def colours_of(type_id: str, actor_id: int) -> dict[str, Colour]:
    """Skin and hair of a blueprint, colours of the clothes of one actor.

    Returns:
        Colours by ``upper``, ``lower``, ``skin``, ``hair``, ``accent``, ``shoes`` and ``bag``.
    """
    number = _number(type_id)
    person = hashlib.sha256(type_id.encode()).digest()
    worn = hashlib.sha256(f"{type_id} {actor_id}".encode()).digest()
    hairs = _GREYS if number in ELDERLY else _HAIRS
    skin = person[2] % len(_SKINS)
    # Dark skin goes with dark hair.
    hair = hairs[person[3] % (2 if skin > 4 and number not in ELDERLY else len(hairs))]
    found = {
        "upper": _UPPERS[worn[0] % len(_UPPERS)],
        "lower": _LOWERS[worn[1] % len(_LOWERS)],
        "skin": _SKINS[skin],
        "hair": hair,
        "accent": _ACCENTS[worn[4] % len(_ACCENTS)],
        "shoes": _SHOES[worn[5] % len(_SHOES)],
        "bag": _BAGS[worn[6] % len(_BAGS)],
    }
    pattern = dress_of(type_id).pattern
    if number in POLICE:
        found |= {"upper": (26, 32, 50), "lower": (24, 28, 42), "accent": (150, 170, 200),
                  "bag": (20, 24, 38), "shoes": (24, 22, 22)}  # fmt: skip
    elif number and pattern == "vest":
        found |= {"accent": (228, 120, 30), "bag": (232, 190, 40)}
    return found
