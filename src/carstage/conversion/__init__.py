"""From a raw log to the files of a dataset: sensor files, label tables, ledger.

``EpisodeConversion`` turns one recorded attempt into one folder of files, segment by segment, in
the processes of ``conversion_pool``.
"""

from carstage.conversion.episode import EpisodeConversion
from carstage.conversion.pool import conversion_pool, load_libraries

__all__ = ["EpisodeConversion", "conversion_pool", "load_libraries"]
