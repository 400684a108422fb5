"""Is a configuration right, and what would it record?"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from carstage.errors import BadInputError, CarStageError, ConfigError
from carstage.web.configure.problems import problems_of
from carstage.web.messages import ConfigCheck, Estimate, FieldProblem
from carstage.web.messages.base import Document
from carstage.web.roots import Roots
from carstage.web.wording import page_words, problem_in_page_words

if TYPE_CHECKING:
    from carstage.config import Config
    from carstage.config.servers import ServerConfig
    from carstage.plan import RunEstimate, ServerFacts

_MOST_PLANNED = 200
"""Episodes are planned one by one: of more, the estimate is scaled up."""


class ConfigChecker:
    """Checks configurations: by the schema, by what the embedded simulator offers, by the disk.

    Args:
        roots: where datasets go, and where recorded episodes may be replayed from.
    """

    def __init__(self, roots: Roots) -> None:
        self._roots = roots

    def parse(self, document: Document) -> Config:
        """The configuration of a document.

        Raises:
            ConfigError: a value is wrong.
        """
        from carstage.config import check_config

        try:
            config = check_config(document)
        except (RecursionError, UnicodeError) as error:
            raise ConfigError("The document is nested too deeply or is no text.") from error
        self._confine(config)
        return config

    def check(self, document: Document) -> ConfigCheck:
        """The verdict; never raises for what a user can write."""
        try:
            config = self.parse(document)
            warnings = [*map(page_words, config.warnings()), *_notes(config)]
            return ConfigCheck(ok=True, warnings=warnings, estimate=self.estimate(config))
        except ConfigError as error:
            found = [problem_in_page_words(problem) for problem in problems_of(error)]
            return ConfigCheck(ok=False, errors=found)
        except CarStageError as error:
            whole = FieldProblem(path=[], message=error.message, hint=error.hint)
            return ConfigCheck(ok=False, errors=[problem_in_page_words(whole)])

    def estimate(self, config: Config) -> Estimate:
        """What a configuration would record.

        Raises:
            ConfigError: the embedded simulator lacks a map, a blueprint or an attribute.
            BadInputError: the episode to replay cannot be read.
        """
        from carstage.config.dimensions import maps_of
        from carstage.config.patches import with_whole_paths
        from carstage.plan import estimate_run, plan_episodes
        from carstage.runs.preflight import check_codecs, disk_need, fits, recording_of

        check_codecs(config)
        planned = min(config.episodes, max(1, _MOST_PLANNED // max(1, len(config.variants))))
        few = with_whole_paths(config, self._roots.home).model_copy(update={"episodes": planned})
        recording = recording_of(config, self._roots.home)
        names = [*maps_of(config), *([] if recording is None else [recording.map])]
        episodes = plan_episodes(few, self._facts(config, names), recording)
        estimate = estimate_run(few, episodes)
        scale = config.episodes / planned
        estimate = _scaled(config, estimate, scale)
        peak_bytes = disk_need(estimate)
        work_bytes = disk_need(estimate, dataset_elsewhere=True)
        free_bytes = self._roots.free_bytes()
        return Estimate(
            episodes=config.planned_episodes,
            frames=round(episodes.frames * scale),
            sensors=len(config.located_sensors()),
            hidden_sensors=sum(sensor.hidden for sensor in episodes[0].streams.values()),
            dataset_bytes=estimate.dataset_bytes,
            peak_bytes=peak_bytes,
            work_bytes=work_bytes,
            duration_s=round(estimate.duration_s, 1),
            disk_free_bytes=free_bytes,
            fits=fits(peak_bytes, free_bytes),
            fits_elsewhere=fits(work_bytes, free_bytes),
        )

    def _facts(self, config: Config, names: list[str]) -> ServerFacts:
        """What the embedded simulator offers; of other servers nothing is known before the run."""
        from carstage.config.own_maps import own_maps
        from carstage.config.scene import map_name
        from carstage.config.servers import EmbeddedServerConfig
        from carstage.plan import ServerFacts
        from carstage.runs.servers import embedded_facts

        any_spawn_point = 1 << 30
        if isinstance(config.server, EmbeddedServerConfig):
            # A town may take a minute to make, only to count its spawn points: a form cannot wait.
            return embedded_facts(
                config.server.carla_version,
                own_maps(config, self._roots.home),
                lambda *_: any_spawn_point,
            )
        return ServerFacts(
            maps={map_name(name): any_spawn_point for name in names} | {"any": any_spawn_point}
        )

    def _confine(self, config: Config) -> None:
        """Refuse episodes and maps from outside the roots, and to run any program that is named.

        Raises:
            ConfigError: the episode or a map lies elsewhere, or the interpreter is none that was
                found here.
        """
        from carstage.config.drivers import ClassDriver, ReplayDriver
        from carstage.config.explain import error_of
        from carstage.config.own_maps import map_sources
        from carstage.config.scene import (
            LogScenario,
            OpenScenarioScenario,
            ReplayScenario,
            ScenicScenario,
        )
        from carstage.files.home import without_tilde

        refuse_foreign_code(config.server)
        for field, source in map_sources(config, self._roots.home):
            try:
                self._roots.confine(str(source))
            except BadInputError as error:
                raise error_of([(field, error.message, error.hint)]) from error
        self._confine_patches(config)
        driver = config.ego.driver
        places: list[tuple[tuple[str, ...], str]] = []
        for where, one in config.located_drivers():
            if isinstance(one, ClassDriver):
                message = "a class of yours runs its code, which the page does not."
                hint = "Start this run with `carstage run`."
                raise error_of([((*where, "name"), message, hint)])
        scenario = config.scenario
        if isinstance(scenario, OpenScenarioScenario) and scenario.scenario_runner is None:
            places.append((("scenario", "file"), scenario.file))
        elif isinstance(scenario, ScenicScenario | OpenScenarioScenario):
            message = "a program of yours would play it, which the page does not start."
            hint = "Start this run with `carstage run`."
            raise error_of([(("scenario", "file"), message, hint)])
        if isinstance(config.scenario, ReplayScenario):
            places.append((("scenario", "episode"), config.scenario.episode))
        if isinstance(config.scenario, LogScenario):
            places.append((("scenario", "file"), config.scenario.file))
        if isinstance(driver, ReplayDriver):
            places.append((("ego", "driver", "episode"), driver.episode))
        for place, path in places:
            try:
                self._roots.confine(str(without_tilde(path)))
            except BadInputError as error:
                raise error_of([(place, error.message, error.hint)]) from error

    def _confine_patches(self, config: Config) -> None:
        """Refuse pictures of patches from outside the roots.

        Raises:
            ConfigError: a picture lies elsewhere.
        """
        from carstage.config.explain import error_of
        from carstage.config.patches import patch_file

        for position, patch in enumerate(config.patches):
            if patch.file is None:
                continue
            try:
                self._roots.confine(str(patch_file(patch.file, self._roots.home)))
            except BadInputError as error:
                place = ("patches", position, "file")
                raise error_of([(place, error.message, error.hint)]) from error


def _scaled(config: Config, estimate: RunEstimate, scale: float) -> RunEstimate:
    """The estimate of so many times as many episodes."""
    from carstage.plan import RunEstimate

    if scale == 1.0:
        return estimate
    dataset_bytes = round(estimate.dataset_bytes * scale)
    kept = config.output.keep_raw or config.conversion.mode == "deferred"
    at_once = estimate.peak_bytes - estimate.dataset_bytes
    raw_bytes = round(estimate.raw_bytes * scale)
    return RunEstimate(
        dataset_bytes=dataset_bytes,
        raw_bytes=raw_bytes,
        peak_bytes=dataset_bytes + (raw_bytes if kept else at_once),
        duration_s=estimate.duration_s * scale,
    )


def _notes(config: Config) -> list[str]:
    """What the form cannot show of a configuration."""
    notes = []
    if config.campaign is not None:
        names = ", ".join(config.campaign.sample)
        sampled = f"; what the form shows of {names} is one value of many" if names else ""
        notes.append(f"campaign: it is edited as text{sampled}.")
    if config.variants:
        notes.append(f"variants: {', '.join(config.variants)}; they are edited as text.")
    return notes


def refuse_foreign_code(server: ServerConfig) -> None:
    """Refuse a server that runs a class of the user's, or an interpreter not found here.

    Raises:
        ConfigError: it is one.
    """
    from carstage.config.servers import ClassServerConfig

    if isinstance(server, ClassServerConfig):
        message = "a class of yours runs its code, which the page does not."
        raise _refusal("server", "name", message, "Start this run with `carstage run`.")
    _check_interpreter(server.client_python)


def _check_interpreter(wanted: str) -> None:
    """Let requests name only interpreters that are found here anyway.

    Raises:
        ConfigError: it is another one.
    """
    from carstage.server.interpreters import AUTO, clients_here

    if wanted in (AUTO, sys.executable):
        return  # without a look for others, which takes seconds
    known = sorted({sys.executable, *(str(python.path) for python in clients_here())})
    if wanted not in known:
        message = f"{wanted!r} is none of the interpreters with a client wheel here."
        hint = f"`auto`, or one of: {', '.join(known)}."
        raise _refusal("server", "client_python", message, hint)


def _refusal(section: str, name: str, message: str, hint: str) -> ConfigError:
    problem = ((section, name), message, hint)
    return ConfigError(f"{section}.{name}: {message}", hint, (problem,))
