"""The configuration that all browsers share: one revision after the other, kept in a file."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from pathlib import Path

from carstage.errors import ConfigError
from carstage.files.whole import write_whole
from carstage.web.configure.checking import ConfigChecker
from carstage.web.messages import ConfigChange, ConfigConflict, ConfigSaved, ConfigState
from carstage.web.messages.base import Document


class ConfigStore:
    """Holds the newest valid configuration; safe to use from several threads.

    Args:
        path: file that it is kept in.
        checker: what is valid.
        changed: called with each new state, in the thread that changed it.
    """

    def __init__(
        self, path: Path, checker: ConfigChecker, changed: Callable[[ConfigState], None]
    ) -> None:
        self._path = path
        self._checker = checker
        self._changed = changed
        self._lock = threading.Lock()
        self._state: ConfigState | None = None

    def state(self) -> ConfigState:
        """The newest configuration; at the very first, the demonstration's."""
        with self._lock:
            return self._current()

    def change(self, change: ConfigChange) -> ConfigSaved | ConfigConflict:
        """Take a change of the newest revision; what was changed meanwhile is given back.

        Raises:
            ConfigError: the configuration is wrong.
        """
        from carstage.config import dump_config

        config = self._checker.parse(change.config)
        estimate = self._checker.estimate(config)
        with self._lock:
            current = self._current()
            if change.rev != current.rev:
                return ConfigConflict(
                    code="conflict",
                    message="The configuration was changed meanwhile.",
                    hint="Take the other one, or keep yours by saving it once more.",
                    current=current,
                )
            state = ConfigState(
                rev=current.rev + 1, config=dump_config(config), author=change.author
            )
            self._keep(state)
            self._state = state
        self._changed(state)
        return ConfigSaved(**state.model_dump(), estimate=estimate, warnings=config.warnings())

    def _current(self) -> ConfigState:
        if self._state is None:
            self._state = self._kept() or ConfigState(rev=0, config=self._first(), author="")
        return self._state

    def _first(self) -> Document:
        from carstage.config import dump_config, load_demo

        return dump_config(load_demo())

    def _kept(self) -> ConfigState | None:
        """What an earlier process left, if it still is a configuration."""
        from carstage.config import dump_config

        try:
            state = ConfigState.model_validate(json.loads(self._path.read_bytes()))
            config = self._checker.parse(state.config)
        except (OSError, ValueError, ConfigError):
            return None
        return state.model_copy(update={"config": dump_config(config)})

    def _keep(self, state: ConfigState) -> None:
        write_whole(self._path, state.model_dump_json().encode())
