"""The contract of an exporter, and the choice of one by the name of its format."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import fields
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar

from carstage.dataset import Episode
from carstage.dataset.saved_frames import Frame
from carstage.dataset.splits import SPLITS, Split
from carstage.errors import BadInputError
from carstage.exporters.options import ExportOptions, flag_of

ENTRY_POINT_GROUP = "carstage.exporters"


class FrameWriter(Protocol):
    """The work on one frame; runs in another process, so it has to be picklable.

    Its class or function is in a module that can be imported: the processes do not run the program
    that called ``export_dataset``.
    """

    def __call__(self, frame: Frame, folder: Path) -> Any:
        """Write the frame's own files below ``folder``.

        Only files of this frame: others are written at the same time. Folders that the exporter
        made exist.

        Returns:
            What ``Exporter.add`` needs, picklable; ``None``: the frame has nothing to export.
        """


class Exporter(ABC):
    """Writes a dataset in another format (``carstage.testing.exporter`` checks one).

    The calls come in this order, all from one process: ``begin``; for each episode, sorted by id,
    ``begin_episode``, ``add`` for each frame in order, ``end_episode``; ``finish``. The frames
    themselves go through the ``FrameWriter`` in other processes meanwhile. What ``add`` keeps may
    not grow with the data of the frames: tables are written as they come.

    The folder is a temporary one that gets its name when all went well, so an exporter need not
    clean up. Equal datasets and options give equal bytes: no clock, no random tokens.

    Attributes:
        name: what users write.
        summary: one line about it.
        uses: the names of the options that it knows; others are refused, but for the choice of
            episodes and variants, which is not for formats to know.
        files: holds what the exporter has open.
        sensors_left_out: by id of a sensor, the frames whose data the format has no place for; for
            formats that say they hold every sensor.
        with_agents: whether it writes what agents beside the ego recorded, too; other formats have
            one car in a frame, and users choose whose.
        with_maps: whether it writes vector maps; those of a dataset are then examined, too.
        splits: the split of each episode by its id, set before ``begin``; see ``split_of``.
        lost_maps: ids of the episodes whose vector map is missing or damaged, set likewise.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    uses: ClassVar[frozenset[str]]
    with_agents: ClassVar[bool] = False
    with_maps: ClassVar[bool] = False

    def __init__(self, options: ExportOptions) -> None:
        self.options = options
        self.files = ExitStack()
        self.sensors_left_out: Counter[str] = Counter()
        self.splits: Mapping[str, Split] = {}
        self.lost_maps: frozenset[str] = frozenset()

    def split_of(self, episode: Episode) -> Split:
        """The split of an episode: ``train`` unless the dataset or the user says otherwise."""
        return self.splits.get(episode.id, "train")

    def used_splits(self, episodes: Iterable[Episode]) -> tuple[Split, ...]:
        """The splits that have an episode; formats make nothing for the others."""
        used = {self.split_of(episode) for episode in episodes}
        return tuple(split for split in SPLITS if split in used)

    @abstractmethod
    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Look at the rigs and prepare the folder.

        Raises:
            BadInputError: the dataset lacks what the format needs.
        """

    @abstractmethod
    def begin_episode(self, episode: Episode) -> FrameWriter:
        """The writer for the frames of this episode."""

    @abstractmethod
    def add(self, part: Any) -> None:
        """Take what the writer returned for the next frame of the episode; never ``None``."""

    @abstractmethod
    def end_episode(self) -> None:
        """All frames of the episode were added."""

    @abstractmethod
    def finish(self) -> None:
        """All episodes were added: write what is common to them and close all files."""

    def close(self) -> None:
        """Close what is open; called at the very end, also where something failed before."""
        self.files.close()


_Class = TypeVar("_Class", bound=type[Exporter])
_exporters: dict[str, type[Exporter]] = {}


def register(exporter: _Class) -> _Class:
    """Class decorator: users can ask for this exporter by its name."""
    _exporters[exporter.name] = exporter
    return exporter


def exporters() -> dict[str, type[Exporter]]:
    """All exporters by name, sorted."""
    _load_installed()
    return dict(sorted(_exporters.items()))


def exporter_for(name: str, options: ExportOptions) -> Exporter:
    """An exporter for a format.

    Raises:
        BadInputError: no such format, or it does not know one of the options.
    """
    known = exporters()
    if name not in known:
        raise BadInputError(f"No export format {name!r}.", f"Formats: {', '.join(known)}.")
    flags = {option.name: flag_of(option) for option in fields(ExportOptions)}
    for given in options.given():
        everybodys = ("episodes", "variant", *(() if known[name].with_agents else ("agent",)))
        if given not in everybodys and given not in known[name].uses:
            used = ", ".join(flags[use] for use in sorted(known[name].uses))
            raise BadInputError(
                f"The format {name} does not use {flags[given]}.", f"It uses {used}."
            )
    return known[name](options)


@cache
def _load_installed() -> None:
    """Import our formats, and those that other distributions declare as entry points, once."""
    import carstage.exporters.formats  # noqa: F401 - registers them

    for entry in entry_points(group=ENTRY_POINT_GROUP):
        entry.load()
