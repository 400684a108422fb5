"""Video: a file per camera and episode, lossless or as any player and web page takes it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from carstage.dataset import Episode
from carstage.dataset.saved_frames import Frame
from carstage.errors import BadInputError
from carstage.exporters.exporter import Exporter, register
from carstage.exporters.options import CodecChoice
from carstage.exporters.rigs import colour_cameras

if TYPE_CHECKING:
    from av.container import OutputContainer
    from av.video.stream import VideoStream


class _Coding(NamedTuple):
    """How FFmpeg writes a codec: encoder, suffix of the container, pixels, options."""

    encoder: str
    suffix: str
    pixels: str
    options: dict[str, str]


_CODINGS: dict[CodecChoice, _Coding] = {
    # Every frame can be decoded by itself, and has a checksum.
    "ffv1": _Coding(
        "ffv1", ".mkv", "bgr0", {"level": "3", "g": "1", "slicecrc": "1", "threads": "2"}
    ),
    # Without cpu-independent, x264's vector code gives other bytes from equal pictures in about
    # half of all runs (not with mbtree=0 or asm=0; measured with PyAV 17.1, x264 core 165).
    "h264": _Coding(
        "libx264",
        ".mp4",
        "yuv420p",
        {"crf": "18", "preset": "medium", "threads": "1", "x264-params": "cpu-independent=1"},
    ),
}
_FEWEST_PER_S = 1000
"""Denominator up to which a frame rate is taken for a ratio of whole numbers."""


@dataclass(frozen=True, slots=True)
class PictureReader:
    """Decodes the pictures of a frame, in another process than the one that encodes."""

    cameras: tuple[str, ...]

    def __call__(self, frame: Frame, folder: Path) -> tuple[int, dict[str, NDArray[np.uint8]]]:
        """Index of the frame, and ``(H, W, 3)`` RGB by camera; without those that are missing."""
        del folder
        return frame.k, {name: frame.read(name) for name in self.cameras if frame.has(name)}


class _Clip:
    """One file; saved frame ``k`` is shown from ``k / fps`` on, ``fps`` that of saved frames."""

    def __init__(self, path: Path, coding: _Coding, fps: Fraction, width: int, height: int) -> None:
        import av

        self._time_base = 1 / fps
        self._container: OutputContainer = av.open(
            str(path), "w", container_options={"fflags": "+bitexact"}
        )
        stream = cast("VideoStream", self._container.add_stream(coding.encoder, rate=fps))
        stream.width, stream.height, stream.pix_fmt = width, height, coding.pixels
        stream.time_base = stream.codec_context.time_base = self._time_base
        stream.options = {**coding.options, "flags": "+bitexact"}
        self._stream = stream

    def add(self, k: int, picture: NDArray[np.uint8]) -> None:
        """Append frame ``k``; a missing one leaves a gap, in which players hold the one before."""
        import av

        frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
        frame.pts, frame.time_base = k, self._time_base
        self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Write what the encoder holds back, and the index."""
        self._container.mux(self._stream.encode(None))
        self._container.close()

    def abandon(self) -> None:
        """Close the file as it is; more than once does no harm."""
        self._container.close()


@register
class Video(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "video"
    summary: ClassVar = "A video per colour camera and episode, lossless or H.264 (extra `video`)."
    uses: ClassVar = frozenset({"cameras", "codec"})

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Check the rigs.

        Raises:
            BadInputError: the extra is not installed, or a camera does not fit.
        """
        if find_spec("av") is None:
            raise BadInputError(
                "The format video needs a package that is not installed.",
                "Install it: pip install 'carstage[video]'.",
            )
        self._coding = _CODINGS[self.options.codec or "ffv1"]
        for episode in episodes:
            for camera in colour_cameras(episode, self.options, labelled=False):
                if self._coding.pixels == "yuv420p" and (camera.width % 2 or camera.height % 2):
                    raise BadInputError(
                        f"H.264 takes pictures of even width and height; {camera.id} of episode "
                        f"{episode.id} has {camera.width} x {camera.height}.",
                        "Export without loss: --codec ffv1.",
                    )
        self._folder = folder

    def begin_episode(self, episode: Episode) -> PictureReader:
        """Open the episode's files."""
        cameras = colour_cameras(episode, self.options, labelled=False)
        steps_per_s = Fraction(episode.spec.fps).limit_denominator(_FEWEST_PER_S)
        fps = steps_per_s / episode.spec.save_every
        self._clips: dict[str, _Clip] = {}
        for camera in cameras:
            path = self._folder / f"{episode.id}_{camera.id}{self._coding.suffix}"
            clip = _Clip(path, self._coding, fps, camera.width, camera.height)
            self.files.callback(clip.abandon)
            self._clips[camera.id] = clip
        return PictureReader(tuple(camera.id for camera in cameras))

    def add(self, part: tuple[int, dict[str, NDArray[np.uint8]]]) -> None:
        """Encode the pictures."""
        k, pictures = part
        for camera_id, picture in pictures.items():
            self._clips[camera_id].add(k, picture)

    def end_episode(self) -> None:
        """Close the episode's files."""
        for clip in self._clips.values():
            clip.close()
        self.close()

    def finish(self) -> None:
        """Every file is whole already."""
