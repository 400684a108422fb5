"""Patches: pictures on billboards, shop fronts, lorries and people, recorded with and without."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, Strict, model_validator

from carstage.config.explain import error_of
from carstage.config.fields import Section, problem, setting
from carstage.files.bounded import open_regular
from carstage.files.home import without_tilde
from carstage.spec.patches import (
    BOARDS,
    FARTHEST_M,
    LARGEST_SIZE,
    LEAST_SIZE,
    MOST_PATCHES,
    SIDES,
    TARGETS,
)

if TYPE_CHECKING:
    from carstage.config.model import Config

LARGEST_PICTURE_BYTES = 32 << 20
WITH, WITHOUT = "patched", "plain"
"""Names of the two variants that are recorded where the user names none."""
PATTERNS = ("noise", "checker", "blobs")
_Share = Annotated[float, Field(ge=0.0, le=1.0)]
_Size = Annotated[float, Field(ge=LEAST_SIZE, le=LARGEST_SIZE)]
_Sizes = Annotated[tuple[_Size, _Size], Strict(strict=False)]
_Distance = Annotated[float, Field(ge=0.0, le=FARTHEST_M)]
_Distances = Annotated[tuple[_Distance, _Distance], Strict(strict=False)]


class Patch(Section):
    """A picture on something that the cameras see."""

    target: Literal["billboard", "shop_front", "vehicle_rear", "person"] = setting(
        title="Target",
        description="A board beside the road, on a wall, or on a large vehicle's rear; a case "
        "before a pedestrian's chest.",
        group="scene",
    )
    pattern: Literal["noise", "checker", "blobs"] | None = setting(
        None,
        title="Pattern",
        description="A generated picture, another one in every episode. One of pattern and file is "
        "needed.",
        group="scene",
    )
    file: str | None = setting(
        None,
        title="Picture file",
        description="A picture of yours (PNG, JPEG, …); relative to the working directory. It gets "
        "at most 128 px a side.",
        group="scene",
    )
    size: _Size | _Sizes = setting(
        (0.5, LARGEST_SIZE),
        title="Size",
        description="As a share of the largest that fits on the board, or `[low, high]` to draw "
        "from.",
        group="scene",
    )
    position: Literal["random"] | Annotated[tuple[_Share, _Share], Strict(strict=False)] = setting(
        "random",
        title="Position",
        description="On the board, `[across, up]`: shares of the room that is left, or `random`.",
        group="scene",
    )
    distance_m: _Distance | _Distances = setting(
        (12.0, 30.0),
        title="Distance",
        description="From the ego's start, or `[low, high]` to draw from; vehicles and pedestrians "
        "begin there.",
        unit="m",
        group="scene",
    )
    side: Literal["right", "left", "random"] = setting(
        "right",
        title="Side",
        description="Of the road; not for vehicles.",
        group="scene",
    )
    board: str | None = setting(
        None,
        title="Board",
        description="Blueprint of the prop that the picture is on; null: "
        f"`{BOARDS['person']}` for a person, else `{BOARDS['billboard']}`.",
        group="scene",
    )

    @model_validator(mode="after")
    def _check_picture(self) -> Patch:
        if (self.pattern is None) == (self.file is None):
            hint = "Give a pattern (noise, checker, blobs), or the file of a picture."
            raise problem("exactly one of pattern and file is needed.", hint, "pattern")
        for name in ("size", "distance_m"):
            low, high = ends(getattr(self, name))
            if low > high:
                raise problem(f"{low:g} is above {high:g}.", "Write [low, high].", name)
        return self


Patches = Annotated[tuple[Patch, ...], Strict(strict=False), Field(max_length=MOST_PATCHES)]
__all__ = ["SIDES", "TARGETS", "Patch", "Patches", "check_patch_files", "patch_file"]


def ends(value: float | tuple[float, float]) -> tuple[float, float]:
    """The low and the high end of a number or a range."""
    return value if isinstance(value, tuple) else (value, value)


def with_pair(data: dict[str, Any]) -> dict[str, Any]:
    """A configuration that shows patches and has no variants records each with and without."""
    if not data.get("patches") or data.get("variants") or data.get("show_patches") is False:
        return data
    return {**data, "variants": {WITH: {}, WITHOUT: {"show_patches": False}}}


def patch_file(text: str, folder: Path | None = None) -> Path:
    """The file of a picture, absolute where ``folder`` is: else below the working directory."""
    return (folder or Path.cwd()) / without_tilde(text)


def check_patch_files(config: Config, folder: Path | None = None) -> None:
    """Refuse pictures that are missing or too large; their contents are read when planning.

    Args:
        config: the configuration.
        folder: what relative paths are relative to; None: the working directory.

    Raises:
        ConfigError: with the paths of the settings.
    """
    found = []
    for position, patch in enumerate(config.patches):
        if patch.file is None:
            continue
        path = patch_file(patch.file, folder)
        try:
            os.close(open_regular(path, LARGEST_PICTURE_BYTES))
        except OSError as error:
            message = f"{path} cannot be read: {error.strerror or error}."
            found.append((("patches", position, "file"), message, "Name a PNG or JPEG file."))
    if found:
        raise error_of(found)


def with_whole_paths(config: Config, folder: Path) -> Config:
    """The configuration with the pictures' files below a folder instead of the working one."""
    patches = tuple(
        patch
        if patch.file is None
        else patch.model_copy(update={"file": str(patch_file(patch.file, folder))})
        for patch in config.patches
    )
    return config.model_copy(update={"patches": patches})
