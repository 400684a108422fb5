"""What one frame of one sensor is on disk: a codec per kind and name, encoder beside decoder.

Importing this package registers the built-in codecs. How to add one: ``docs/formats/dataset.md``.
"""

from carstage.dataset.codecs import depth, images, points  # noqa: F401  (they register themselves)
from carstage.dataset.codecs.codec import Codec, codec_for, codec_names, register

__all__ = ["Codec", "codec_for", "codec_names", "register"]
