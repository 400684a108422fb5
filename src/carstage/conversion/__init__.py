"""From a raw log to the files of a dataset: sensor files, label tables, ledger.

``EpisodeConversion`` turns one recorded attempt into one folder of files, segment by segment, in
the processes of a ``carstage.processes.ProcessPool``. What is listed here is imported when it is
first used: those processes load their libraries in a cheaper way than one import after the other.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from carstage.lazy import lazy_names

if TYPE_CHECKING:
    from carstage.conversion.episode import EpisodeConversion
    from carstage.conversion.fleet import FleetConversion
    from carstage.conversion.libraries import import_libraries
    from carstage.conversion.thread_first import ThreadFirst

__all__ = [
    "EpisodeConversion",
    "FleetConversion",
    "ThreadFirst",
    "import_libraries",
]

__getattr__ = lazy_names(
    __name__,
    {
        "episode": "EpisodeConversion",
        "fleet": "FleetConversion",
        "libraries": "import_libraries",
        "thread_first": "ThreadFirst",
    },
)
