"""Patches on objects: what is on them, where they are put, and how they lie on their boards.

A patch is a picture on a board: a prop of the server's catalogue whose whole surface gets a texture
that is plain but for the picture. So a recording without the patch differs in the texture alone.
"""

from __future__ import annotations

import base64
import binascii
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Optional, Sequence, Tuple

from carstage.spec.fields import Fields, SpecError
from carstage.spec.plain import LEFT_OUT
from carstage.spec.values import Value

BILLBOARD, SHOP_FRONT, VEHICLE_REAR, PERSON = "billboard", "shop_front", "vehicle_rear", "person"
TARGETS = (BILLBOARD, SHOP_FRONT, VEHICLE_REAR, PERSON)
CARRIED = (VEHICLE_REAR, PERSON)
"""Targets that move, and their boards with them."""
SIDES = ("right", "left")
BOARDS = {
    BILLBOARD: "static.prop.ironplank",
    SHOP_FRONT: "static.prop.ironplank",
    VEHICLE_REAR: "static.prop.ironplank",
    PERSON: "static.prop.briefcase",
}
"""Props of CARLA's catalogue, 0.9.13 to 0.9.16, that are flat: a plate of 2.4 m x 1.2 m, and a flat
case of 0.44 m x 0.32 m."""
MOST_PATCHES = 16
PICTURE_PX = 128
"""The longer side of a picture has at most so many pixels."""
LEAST_SIZE, LARGEST_SIZE = 0.1, 0.9
"""Size of a patch as a share of its board."""
FARTHEST_M = 200.0
TEXTURE_PX = 256
"""Texels along the longer side of a board."""
GROUND = (186, 186, 182)
"""Colour of a board around its patch, sRGB."""
_BYTES = 4 * PICTURE_PX * PICTURE_PX


@dataclass(frozen=True, eq=False, repr=False)
class PatchPicture(Value):
    """What a patch shows.

    Attributes:
        width, height: pixels, up to ``PICTURE_PX`` each.
        rgb: base64 of red, green, blue of each pixel, row by row from the top.
    """

    width: int
    height: int
    rgb: str

    @classmethod
    def read(cls, section: Fields) -> PatchPicture:
        """Check and read the section."""
        width = section.integer("width", 1, PICTURE_PX)
        height = section.integer("height", 1, PICTURE_PX)
        text = section.text("rgb")
        try:
            size = len(base64.b64decode(text, validate=True)) if len(text) <= _BYTES else -1
        except binascii.Error:
            size = -1
        if size != 3 * width * height:
            message = "%s: is not base64 of %d x %d pixels." % (section.path("rgb"), width, height)
            raise SpecError(message)
        return cls(width, height, text)

    def pixels(self) -> bytes:
        """Red, green, blue of each pixel, row by row from the top."""
        return base64.b64decode(self.rgb)


@dataclass(frozen=True, eq=False, repr=False)
class PatchSpec(Value):
    """One patch.

    Attributes:
        name: unique in the episode.
        target: one of ``TARGETS``.
        picture: what it shows.
        size: as a share of the largest that fits on the board.
        position: on the board, from left and from below, 0-1 of the room that is left.
        board: blueprint of the prop that it is on.
        distance_m: so far along the ego's lane from where it begins.
        side: of the road; not for vehicles.
        shown: whether the picture is on the board; None: it is.
    """

    name: str
    target: str
    picture: PatchPicture
    size: float
    position: Tuple[float, float]
    board: str
    distance_m: float
    side: str
    shown: Optional[bool] = field(default=None, metadata=LEFT_OUT)

    @classmethod
    def read(cls, section: Fields) -> PatchSpec:
        """Check and read the section."""
        place = section.list("position")
        if len(place) != 2:
            raise SpecError("%s: must be [across, up]." % section.path("position"))
        ends = Fields({"[0]": place[0], "[1]": place[1]}, section.path("position"))
        return cls(
            name=section.text("name"),
            target=section.text("target", TARGETS),
            picture=PatchPicture.read(section.object("picture")),
            size=section.number("size", least=LEAST_SIZE, most=LARGEST_SIZE),
            position=(
                ends.number("[0]", least=0.0, most=1.0),
                ends.number("[1]", least=0.0, most=1.0),
            ),
            board=section.text("board"),
            distance_m=section.number("distance_m", least=0.0, most=FARTHEST_M),
            side=section.text("side", SIDES),
            shown=section.flag("shown") if "shown" in section else None,
        )

    @property
    def is_shown(self) -> bool:
        """Whether the picture is on the board."""
        return self.shown is not False


def read_patches(given: Fields) -> Tuple[PatchSpec, ...]:
    """Check and read the list.

    Raises:
        SpecError: names the field and what is wrong with it.
    """
    sections = given.objects("patches")
    if len(sections) > MOST_PATCHES:
        raise SpecError("%s: has more than %d." % (given.path("patches"), MOST_PATCHES))
    patches = tuple(PatchSpec.read(section) for section in sections)
    if len({patch.name for patch in patches}) < len(patches):
        raise SpecError("%s: two have the same name." % given.path("patches"))
    return patches


class BoardFace(NamedTuple):
    """The larger faces of a board: those across its least side.

    Attributes:
        thin: axis of the box, 0-2, that points out of the front face.
        across, up: axes along the face; a picture's top is towards the positive end of ``up``.
        mirrored: whether a picture on the front runs against ``across``.
    """

    thin: int
    across: int
    up: int
    mirrored: bool


_FACES = (
    BoardFace(0, 1, 2, True),
    BoardFace(1, 0, 2, False),
    BoardFace(2, 1, 0, False),
)


def board_face(extent: Sequence[float]) -> BoardFace:
    """How a texture lies on a board of such half sizes; the embedded simulator does it so."""
    sizes = list(extent)
    return _FACES[sizes.index(min(sizes))]


class PatchPlace(NamedTuple):
    """Where a patch lies in its board's texture, in texels from left and from below.

    Attributes:
        columns, rows: texels of the texture.
        left, low, width, height: of the patch.
    """

    columns: int
    rows: int
    left: int
    low: int
    width: int
    height: int


def patch_place(patch: PatchSpec, extent: Sequence[float]) -> PatchPlace:
    """Where a patch lies in the texture of a board.

    Args:
        patch: the patch.
        extent: half sizes of the board's box, metres.
    """
    face = board_face(extent)
    wide, tall = extent[face.across], extent[face.up]
    scale = TEXTURE_PX / max(wide, tall)
    columns, rows = max(4, round(wide * scale)), max(4, round(tall * scale))
    fit = min(columns / patch.picture.width, rows / patch.picture.height) * patch.size
    width = min(max(1, round(patch.picture.width * fit)), columns - 2)
    height = min(max(1, round(patch.picture.height * fit)), rows - 2)
    left = 1 + round(patch.position[0] * (columns - 2 - width))
    low = 1 + round(patch.position[1] * (rows - 2 - height))
    return PatchPlace(columns, rows, left, low, width, height)


def patch_corners(
    place: PatchPlace, center: Sequence[float], extent: Sequence[float], front: bool
) -> Tuple[Tuple[float, float, float], ...]:
    """Corners of a patch in the board's frame: top left, top right, bottom right, bottom left.

    Args:
        place: of the patch in the texture.
        center, extent: of the board's box, metres.
        front: whether on the face to which the thin axis points, or else on the back, where the
            texture is seen, too.
    """
    face = board_face(extent)
    ends = []
    for column, row in (
        (place.left, place.low + place.height),
        (place.left + place.width, place.low + place.height),
        (place.left + place.width, place.low),
        (place.left, place.low),
    ):
        across = (2.0 * column / place.columns - 1.0) * extent[face.across]
        corner: Any = list(center)
        corner[face.across] += -across if face.mirrored == front else across
        corner[face.up] += (2.0 * row / place.rows - 1.0) * extent[face.up]
        corner[face.thin] += extent[face.thin] if front else -extent[face.thin]
        ends.append((corner[0], corner[1], corner[2]))
    return tuple(ends)
