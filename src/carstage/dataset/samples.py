"""All frames of a dataset as a sequence with random access, for training loops."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

from carstage.dataset.collection import Dataset
from carstage.dataset.ledger import recorded_frames
from carstage.dataset.saved_frames import EpisodeFrames, Frame
from carstage.dataset.splits import Split
from carstage.errors import BadInputError
from carstage.storage.remote_path import DatasetPath

Sample = TypeVar("Sample")
_OPEN_EPISODES = 16
"""Episodes whose tables are kept in memory; some megabytes each."""


class FrameSamples(Generic[Sample]):
    """Frames of all episodes, one after the other, each made into a sample when it is asked for.

    It has ``__len__`` and ``__getitem__`` and nothing else of a framework: what takes a map-style
    dataset takes it, such as ``torch.utils.data.DataLoader``. It can be pickled, also to worker
    processes that are spawned: only the path and the index travel, each process opens the files
    itself.

    Args:
        path: folder or address of the dataset; or the dataset: of one with chosen episodes, these
            alone, and as the agent that it is of.
        read: makes the sample of a frame; must be a function that can be pickled (one of a module)
            if the samples go to other processes.
        sensors: only frames that all of these have data of.
        episodes: ids of the episodes to take, in this order; default: all, sorted by id.
        split: take the episodes of this split of the dataset instead.

    Raises:
        DatasetError: the folder is no dataset, or a ledger cannot be read.
        BadInputError: an episode or sensor is unknown, no episode is in the split, or both
            ``episodes`` and ``split`` are given.
    """

    def __init__(
        self,
        path: str | DatasetPath | Dataset,
        read: Callable[[Frame], Sample],
        *,
        sensors: Sequence[str] = (),
        episodes: Sequence[str] | None = None,
        split: Split | None = None,
    ) -> None:
        dataset = path if isinstance(path, Dataset) else Dataset(path)
        self._path = dataset.path
        self._agent = next((one.agent_name for one in dataset.episodes), None)
        self._read = read
        if split is not None:
            if episodes is not None:
                raise BadInputError("Both episodes and a split are given.", "Give one of them.")
            episodes = [episode.id for episode in dataset.split(split)]
        known = {episode.id: episode for episode in dataset.episodes}
        self._index: list[tuple[str, int]] = []
        for episode_id in known if episodes is None else episodes:
            if episode_id not in known:
                raise BadInputError(
                    f"{self._path} has no episode {episode_id}.", f"Episodes: {', '.join(known)}."
                )
            episode = known[episode_id]
            recorded = recorded_frames(episode.calibration.sensors, episode.ledger())
            frames = set(range(episode.frames))
            for sensor in sensors:
                frames &= set(recorded[episode.sensor(sensor).id])
            self._index += [(episode_id, k) for k in sorted(frames)]
        self._open: OrderedDict[str, EpisodeFrames] = OrderedDict()
        self._dataset: Dataset | None = None

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._index)

    def __getitem__(self, index: int) -> Sample:
        """The sample of a frame.

        Raises:
            IndexError: there is no such frame.
            DatasetError: its files are missing or damaged.
        """
        return self._read(self.frame(index))

    def frame(self, index: int) -> Frame:
        """The frame that a sample is made of.

        Raises:
            IndexError: there is no such frame.
        """
        episode_id, k = self._index[index]
        return self._frames_of(episode_id).frame(k)

    def _frames_of(self, episode_id: str) -> EpisodeFrames:
        if episode_id in self._open:
            self._open.move_to_end(episode_id)
            return self._open[episode_id]
        if self._dataset is None:
            self._dataset = Dataset(self._path)
        episode = self._dataset.episode(episode_id)
        frames = EpisodeFrames(episode if self._agent is None else episode.agent(self._agent))
        self._open[episode_id] = frames
        if len(self._open) > _OPEN_EPISODES:
            self._open.popitem(last=False)
        return frames

    def __getstate__(self) -> dict[str, Any]:
        """What another process needs: nothing that is open."""
        return {**self.__dict__, "_open": OrderedDict(), "_dataset": None}
