"""Our own PNG files, and the deflate encoder for colour pictures.

Why it is ours: a camera's colour pictures are most of a dataset and of the conversion's work. Of
1280x720 pixels with a camera's noise (``benchmarks/results/codecs.json``):

- this package makes 1.76 MB with 20.9 ms of CPU;
- ``fpng`` makes 1.92 MB with 12.6 ms: faster, but its files are 9 % larger (ours are 8 % smaller).
  It is the codec ``fpng`` of the extra ``fast-png``;
- libdeflate at level 1, the codec ``png-small``, makes 1.82 MB with 51.3 ms.

So the gain beside ``fpng`` is disk space, not speed. Nothing outside imports its modules.
"""

from carstage.codecs.png.deflate_runs import ZlibOfRuns
from carstage.codecs.png.files import PngPacker, pixel_words, unpack_png, unpack_rgb16

__all__ = ["PngPacker", "ZlibOfRuns", "pixel_words", "unpack_png", "unpack_rgb16"]
