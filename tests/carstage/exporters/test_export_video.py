"""Video exports, decoded by FFmpeg: the recorded pictures, each at its time."""

from __future__ import annotations

import shutil
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from analytic_dataset import SIZE, make_dataset
from carstage.dataset import Dataset
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions, export_dataset

pytestmark = pytest.mark.xdist_group("export")


def decoded(path: Path) -> dict[Fraction, np.ndarray]:
    """Pictures by the time at which they are shown (s)."""
    with av.open(str(path)) as container:
        return {
            Fraction(frame.pts) * frame.time_base: frame.to_ndarray(format="rgb24")
            for frame in container.decode(video=0)
        }


def test_lossless_video_holds_every_recorded_pixel(exported, dataset) -> None:
    episode = Dataset(dataset).episodes[0]
    out = exported("video")
    cameras = [sensor for sensor in episode.sensors if sensor.kind == "rgb"]
    assert len(list(out.glob("*.mkv"))) == len(cameras) >= 2
    for camera in cameras:
        frames = decoded(out / f"{episode.id}_{camera.id}.mkv")
        assert len(frames) == episode.frames
        for k, (time_s, picture) in enumerate(frames.items()):
            assert float(time_s) == pytest.approx(k / episode.spec.fps, abs=1e-3)
            np.testing.assert_array_equal(picture, camera.read(k))


def test_h264_video_is_smaller_and_still_the_picture(exported, dataset) -> None:
    episode = Dataset(dataset).episodes[0]
    camera = next(sensor for sensor in episode.sensors if sensor.kind == "rgb")
    lossless = exported("video") / f"{episode.id}_{camera.id}.mkv"
    small = exported("video", codec="h264", cameras=(camera.id,))
    assert [path.name for path in small.glob("*.mp4")] == [f"{episode.id}_{camera.id}.mp4"]
    (video,) = small.glob("*.mp4")
    assert video.stat().st_size < lossless.stat().st_size
    for k, (time_s, picture) in enumerate(decoded(video).items()):
        assert float(time_s) == pytest.approx(k / episode.spec.fps, abs=1e-3)
        error = picture.astype(float) - camera.read(k)
        assert 10 * np.log10(255.0**2 / np.mean(error**2)) > 30.0


@pytest.mark.parametrize("codec", ["ffv1", "h264"])
def test_equal_datasets_give_equal_bytes(exported, dataset, tmp_path, codec) -> None:
    first = exported("video", codec=codec)
    export_dataset(dataset, tmp_path / "again", "video", ExportOptions(codec=codec), workers=0)
    for path in first.glob("*.m*"):
        assert path.read_bytes() == (tmp_path / "again" / path.name).read_bytes()


def test_missing_picture_leaves_a_gap_and_moves_no_other(dataset, tmp_path) -> None:
    damaged = tmp_path / "damaged"
    shutil.copytree(dataset, damaged)
    episode = Dataset(damaged).episodes[0]
    camera = next(sensor for sensor in episode.sensors if sensor.kind == "rgb")
    camera.paths(2)[0].unlink()
    export_dataset(damaged, tmp_path / "out", "video", allow_incomplete=True, workers=0)
    frames = decoded(tmp_path / "out" / f"{episode.id}_{camera.id}.mkv")
    fps = episode.spec.fps
    assert [round(float(time_s) * fps) for time_s in frames] == [
        k for k in range(episode.frames) if k != 2
    ]
    np.testing.assert_array_equal(list(frames.values())[2], camera.read(3))


def test_odd_pictures_are_refused_by_h264_alone(tmp_path) -> None:
    width, height = SIZE
    odd = make_dataset(tmp_path / "odd", tmp_path / "raw", size=(width - 1, height))
    with pytest.raises(BadInputError, match="even width") as refused:
        export_dataset(odd, tmp_path / "out", "video", ExportOptions(codec="h264"), workers=0)
    assert "--codec ffv1" in refused.value.hint
    export_dataset(odd, tmp_path / "out", "video", workers=0)
    assert list((tmp_path / "out").glob("*.mkv"))


def test_unknown_camera_is_refused_with_those_there_are(dataset, tmp_path) -> None:
    options = ExportOptions(cameras=("NOSE",))
    with pytest.raises(BadInputError, match="no colour camera 'NOSE'") as refused:
        export_dataset(dataset, tmp_path / "out", "video", options, workers=0)
    assert "CAM" in refused.value.hint


def test_every_second_step_is_shown_at_half_the_rate(tmp_path: Path) -> None:
    dataset = make_dataset(tmp_path / "data", tmp_path, steps=4, save_every=2)
    export_dataset(dataset, tmp_path / "out", "video", workers=0)
    (episode,) = Dataset(dataset).episodes
    times = [float(time_s) for time_s in decoded(tmp_path / f"out/{episode.id}_CAM_FRONT.mkv")]
    assert times == pytest.approx([0.0, 2 / episode.spec.fps], abs=1e-3)
