"""What a process loads before it converts."""

from __future__ import annotations

import importlib

from carstage.lazy import keep_pandas_lazy


def import_libraries(pictures: bool) -> None:
    """Import what work on a segment needs; with pictures, encode one: up to two seconds.

    Args:
        pictures: also what only pictures need, which is more than half of it.
    """
    # Not before this is called: the supervisor needs none of it.
    for name in ("whole_episode", "work"):
        importlib.import_module(f"carstage.conversion.{name}")
    for name in ("carstage.codecs.points", "carstage.files.streaming"):
        importlib.import_module(name)
    keep_pandas_lazy()
    if pictures:
        for name in ("birds_eye", "disparity", "flash_lidar", "lane_lines", "patches"):
            importlib.import_module(f"carstage.conversion.{name}")
        from carstage.codecs.images import RgbRunsPng

        for name in ("camera_rows", "object_rows", "pixel_kernel"):
            importlib.import_module(f"carstage.annotation.{name}")
        # The first call of compiled code takes as long as the imports.
        RgbRunsPng().encode({"width": 1, "height": 1}, memoryview(bytes(4)))
