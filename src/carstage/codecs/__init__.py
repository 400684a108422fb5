"""What one frame of one sensor is on disk: a codec per kind and name, encoder beside decoder.

The table of sensor kinds names the codecs of each kind. How to add one:
``docs/formats/dataset.md``.
"""

from carstage.codecs.codec import Codec, codec_for, codec_names, register
from carstage.codecs.semantic_points import SEMANTIC_POINT

__all__ = ["SEMANTIC_POINT", "Codec", "codec_for", "codec_names", "register"]
