"""Pictures of recordings: the demo, grids, voxels, labels of the level."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from typing import Any

import yaml
from PIL import Image

from benchmarks.framework.recorded import record, record_demo
from benchmarks.simulator.traffic.towns import carla_maps
from carstage.dataset import Dataset
from carstage.errors import BadInputError
from carstage.report.birds_eye import birds_eye_picture
from carstage.report.episodes import EpisodePictures
from carstage.report.occupancy import occupancy_picture

_DEMO_S = 5.0
_TILE_PX = (560, 315)
_GAP_PX = 8
_SHARES = (0.04, 0.22, 0.94)
"""When in the demo cars come towards the ego, one passes it, and people wait to cross."""
_AROUND = {"FRONT": 0.0, "RIGHT": 90.0, "BACK": 180.0, "LEFT": -90.0}
_SURROUNDINGS_FRAME = 10
_LEVEL_TOWN, _LEVEL_SPAWN = "Town03", 27
_LEVEL_TRAFFIC = ("bicycle", "motorcycle", "car")


def demo() -> Iterator[tuple[str, Image.Image]]:
    """The README's picture: 3D boxes, 2D boxes above semantic labels, the LiDAR from above."""
    with tempfile.TemporaryDirectory(prefix="carstage-pictures-") as scratch:
        out = Path(scratch) / "demo"
        record_demo(out, _DEMO_S)
        yield "demo.jpg", demo_sheet(_pictures(out))


def demo_sheet(pictures: EpisodePictures) -> Image.Image:
    """Three frames of the episode, the first of them from above, too."""
    sensors = {sensor.id: sensor for sensor in pictures.episode.sensors}
    front, semantic = sensors["CAM_FRONT"], sensors["SEMANTIC_FRONT"]
    first, middle, last = (round(share * (pictures.episode.frames - 1)) for share in _SHARES)
    tiles = (
        (pictures.drawn_3d(front, first), pictures.drawn_3d(front, last)),
        (pictures.drawn_2d(front, middle), (pictures.drawn_view(semantic, middle),)),
    )
    above = pictures.drawn_from_above(first)
    width, height = _TILE_PX
    side = 2 * height + _GAP_PX
    sheet = Image.new("RGB", (2 * (width + _GAP_PX) + side, side), (255, 255, 255))
    for column, tile in enumerate(tiles):
        for row, drawn in enumerate(tile):
            place = (column * (width + _GAP_PX), row * (height + _GAP_PX))
            sheet.paste(_there(drawn).resize(_TILE_PX, Image.Resampling.LANCZOS), place)
    square = _there(above).resize((side, side), Image.Resampling.LANCZOS)
    sheet.paste(square, (2 * (width + _GAP_PX), 0))
    return sheet


def surroundings() -> Iterator[tuple[str, Image.Image]]:
    """Grids and voxels of one frame on the demo's street; the voxels gathered, then exact."""
    for name, exact in (("occupancy", False), ("occupancy-exact", True)):
        with tempfile.TemporaryDirectory(prefix="carstage-pictures-") as scratch:
            (episode,) = Dataset(record(surroundings_config(exact=exact), Path(scratch))).episodes
            if not exact:
                grids = episode.birds_eye(_SURROUNDINGS_FRAME)
                assert grids is not None, "the configuration asks for grids"
                yield "birds-eye.png", birds_eye_picture(grids)
            voxels = episode.occupancy(_SURROUNDINGS_FRAME)
            assert voxels is not None, "the configuration asks for voxels"
            yield f"{name}.png", occupancy_picture(voxels)


def surroundings_config(*, exact: bool) -> dict[str, Any]:
    """The demo's street with cameras to all sides and a semantic LiDAR, for two seconds."""
    sensors: list[dict[str, Any]] = [
        {
            "id": f"CAM_{side}", "kind": "rgb", "pose": {"z": 2.0, "yaw_deg": yaw_deg},
            "attributes": {"fov_deg": 100.0},
        }
        for side, yaw_deg in _AROUND.items()
    ]  # fmt: skip
    sensors.append({"id": "LIDAR_TOP", "kind": "semantic_lidar", "pose": {"z": 2.2}})
    return {
        **_demo_config(),
        "name": "surroundings",
        "duration_s": 2.0,
        "rig": {"sensors": sensors},
        "labels": {"birds_eye": {}, "occupancy": {"exact": exact}},
    }


def level_labels() -> Iterator[tuple[str, Image.Image]]:
    """Masks and boxes of parked cars, traffic lights and riders in one of CARLA's towns.

    Raises:
        BadInputError: its OpenDRIVE file is not there.
    """
    with (
        carla_maps(None, (_LEVEL_TOWN,)) as maps,
        tempfile.TemporaryDirectory(prefix="carstage-pictures-") as scratch,
    ):
        if maps is None:
            raise BadInputError(
                f"The file of {_LEVEL_TOWN} is not there.",
                "Install the extra `dev`: its package py123d has it.",
            )
        pictures = _pictures(record(level_labels_config(maps), Path(scratch)))
        drawn = pictures.drawn_3d(pictures.episode.sensor("CAM_FRONT"), 0, masks=True)
        yield "level-labels.jpg", _there(drawn)


def level_labels_config(maps: Path) -> dict[str, Any]:
    """One frame behind two-wheelers in a street with parked cars, before traffic lights.

    Args:
        maps: folder with the town's OpenDRIVE file.
    """
    camera = {"id": "CAM_FRONT", "kind": "rgb", "pose": {"x": 1.5, "z": 1.6}}
    return {
        **_demo_config(),
        "name": "level-labels",
        "duration_s": 0.1,
        "map": {"choice": _LEVEL_TOWN},
        "ego": {"spawn": _LEVEL_SPAWN},
        "vehicles": {
            "count": 0,
            "radius_m": 60,
            "groups": [{"count": 4, "base_type": kind} for kind in _LEVEL_TRAFFIC],
        },
        "image_size": [960, 540],
        "rig": {"sensors": [camera]},
        "server": {"maps": [str(maps)]},
    }


def _demo_config() -> dict[str, Any]:
    text = resources.files("carstage.config").joinpath("demo.yaml").read_text("utf-8")
    config: dict[str, Any] = yaml.safe_load(text)
    return config


def _pictures(out: Path) -> EpisodePictures:
    """What draws the one episode of a dataset."""
    dataset = Dataset(out)
    (episode,) = dataset.episodes
    return EpisodePictures(episode, dataset.description)


def _there(drawn: tuple[Any, ...] | None) -> Image.Image:
    """The picture of what was drawn; a recording that is whole has each."""
    assert drawn is not None, "the recording lacks a picture"
    picture = drawn[0]
    assert isinstance(picture, Image.Image)
    return picture
