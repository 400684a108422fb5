"""What the handlers use, put together once per process."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

from carstage.web.commands import CommandService
from carstage.web.configure.checking import ConfigChecker
from carstage.web.configure.description import DescriptionService
from carstage.web.configure.schema import SchemaService
from carstage.web.configure.server_check import ServerCheckService
from carstage.web.configure.store import ConfigStore
from carstage.web.configure.texts import ConfigTexts
from carstage.web.configure.town_maps import TownMapService
from carstage.web.datasets.campaigns import CampaignService
from carstage.web.datasets.catalogue import Catalogue
from carstage.web.datasets.episode_index import EpisodeIndex
from carstage.web.datasets.episodes import EpisodeService
from carstage.web.datasets.exports import Exports
from carstage.web.datasets.frame_values import FrameService
from carstage.web.datasets.history import HistoryService
from carstage.web.datasets.jobs import JobService
from carstage.web.datasets.label_tables import LabelTables
from carstage.web.datasets.pictures import Pictures
from carstage.web.live import LiveHub
from carstage.web.loading import load
from carstage.web.messages import ConfigState, Removed
from carstage.web.preview.run_previews import Previews
from carstage.web.preview.sensor_preview import SensorPreviewService
from carstage.web.roots import Roots
from carstage.web.runs.launches import Launches
from carstage.web.runs.service import RunService
from carstage.web.settings import WebSettings

_WARMING_S = 5.0
"""How long the end waits for what was loaded early."""


class Services:
    """The composition root of the server.

    Args:
        settings: roots and state folder.
    """

    def __init__(self, settings: WebSettings) -> None:
        settings.state.mkdir(mode=0o700, parents=True, exist_ok=True)
        roots = Roots(settings.roots, home=settings.home, writable=settings.writable)
        self.schema = SchemaService()
        self.description = DescriptionService()
        self.town_maps = TownMapService(self.description)
        self.checker = ConfigChecker(roots)
        self.config = ConfigStore(settings.state / "config.json", self.checker, self._changed)
        self.texts = ConfigTexts(self.checker, self.config)
        self.server_check = ServerCheckService()
        self.jobs = JobService(settings.state, roots)
        index = EpisodeIndex(settings.state / "episodes.json")
        self.datasets = Catalogue(roots, self.jobs, index)
        self.episodes = EpisodeService(self.datasets, self.description)
        self.history = HistoryService(self.datasets)
        self.frames = FrameService(self.datasets)
        self.pictures = Pictures(self.frames)
        self.tables = LabelTables(self.datasets, roots)
        self.previews = Previews()
        launches = Launches(settings.state / "launches", settings.home)
        self.runs = RunService(
            roots, launches, self.checker, self.config, self.previews, self._make_room
        )
        self.campaigns = CampaignService(roots, self.runs)
        self.sensor_preview = SensorPreviewService(self.checker, self.runs.uses)
        self.exports = Exports(roots, self.jobs)
        self.commands = CommandService(roots, self.runs, self.exports, self.config, self.texts)
        self._roots = roots
        self.live = LiveHub(self.config, self.runs, self.jobs, self.previews, roots)

    @classmethod
    @asynccontextmanager
    async def running(cls, settings: WebSettings) -> AsyncIterator[Services]:
        """The services, with the task that looks after runs; all is given back at the end.

        Runs, exports and validations that go on are left to themselves.
        """
        services = cls(settings)
        looking = asyncio.create_task(services.live.look_on())
        closing = threading.Event()
        warming = threading.Thread(
            target=services.warm_up, args=(closing,), name="warm-up", daemon=True
        )
        warming.start()
        try:
            yield services
        finally:
            closing.set()
            looking.cancel()
            with suppress(asyncio.CancelledError):
                await looking
            await services.live.close()
            await asyncio.to_thread(services.sensor_preview.close)
            await asyncio.to_thread(services.previews.close)
            # A thread that is within a library when the interpreter ends aborts the process.
            await asyncio.to_thread(warming.join, _WARMING_S)

    def warm_up(self, closing: threading.Event) -> None:
        """Do early what the first request for it would have to wait for."""
        load()
        self.schema.message()
        config = self.checker.parse(self.config.state().config)
        self.datasets.all()  # what is new since the last start is read before anybody asks
        self.description.warm(config.ego.blueprint, closing)

    def remove_dataset(self, dataset: str) -> Removed:
        """Remove a dataset, and what is kept of its runs.

        Raises:
            WebError: there is none, or somebody uses it.
            StorageError: something cannot be removed.
        """
        place = self._roots.dataset(dataset).path
        busy = self.runs.records_into(place)
        left = self.datasets.remove(dataset, busy=busy)
        self.runs.forget(place)
        return Removed(left=left)

    def _make_room(self, server: str) -> None:
        self.sensor_preview.make_room(server)

    def _changed(self, state: ConfigState) -> None:
        self.live.config_changed(state)
