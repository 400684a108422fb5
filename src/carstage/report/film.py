"""Short films of an episode with its labels drawn in, by PyAV (extra ``video``)."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable
from fractions import Fraction
from importlib.util import find_spec

import numpy as np
from PIL import Image

from carstage.errors import BadInputError

MOST_FRAMES = 300
_MOST_WIDTH = 640
_FEWEST_PER_S = 1000
_OPTIONS = {"crf": "27", "preset": "medium", "threads": "2", "flags": "+bitexact"}


def require_video() -> None:
    """Refuse films where PyAV is missing.

    Raises:
        BadInputError: it is not installed.
    """
    if find_spec("av") is None:
        raise BadInputError(
            "Films need a package that is not installed.",
            "Install it: pip install 'carstage[video]'.",
        )


def film(pictures: Iterable[tuple[int, Image.Image]], frames_per_s: float) -> str:
    """H.264 in MP4 as a ``data:`` address; frame ``k`` is shown from ``k / frames_per_s`` on.

    Args:
        pictures: index and picture of each frame, all of one size, at least one; scaled down to
            at most 640 pixels and to even sides, as players want them.
        frames_per_s: rate of the saved frames.
    """
    import av

    stream_bytes = io.BytesIO()
    rate = Fraction(frames_per_s).limit_denominator(_FEWEST_PER_S)
    options = {"fflags": "+bitexact"}
    with av.open(stream_bytes, "w", format="mp4", container_options=options) as container:
        stream = container.add_stream("libx264", rate=rate)
        stream.pix_fmt, stream.options = "yuv420p", dict(_OPTIONS)
        stream.time_base = stream.codec_context.time_base = 1 / rate
        size: tuple[int, int] | None = None
        for k, picture in pictures:
            if size is None:  # PyAV takes it before the first picture alone
                scale = min(1.0, _MOST_WIDTH / picture.width)
                width, height = (max(2, int(side * scale) // 2 * 2) for side in picture.size)
                size = stream.width, stream.height = width, height
            small = picture.resize(size, Image.Resampling.LANCZOS)
            frame = av.VideoFrame.from_ndarray(np.asarray(small), format="rgb24")
            frame.pts, frame.time_base = k, 1 / rate
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return f"data:video/mp4;base64,{base64.b64encode(stream_bytes.getvalue()).decode()}"
