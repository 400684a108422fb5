"""The command that does what a button of the page does, for a shell on this machine."""

from __future__ import annotations

import json
import shlex
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from carstage.storage.remote_path import DatasetPath
from carstage.web.configure.store import ConfigStore
from carstage.web.configure.texts import ConfigTexts
from carstage.web.datasets.exports import Exports
from carstage.web.datasets.jobs import export_name
from carstage.web.errors import WebError
from carstage.web.messages import (
    CommandRequest,
    CommandText,
    ConfigExportRequest,
    ExportRequest,
    RunStart,
)
from carstage.web.messages import commands as c
from carstage.web.messages.base import Document
from carstage.web.roots import Roots
from carstage.web.runs.service import RunService

if TYPE_CHECKING:
    from carstage.runs.launching import RunOptions

_END = "CONFIG"
"""What ends the configuration in a command; no line of one is this word alone."""


class CommandService:
    """Writes commands; does nothing itself.

    Args:
        roots: where datasets are.
        runs: what has been recorded.
        exports: what has been exported.
        store: the saved configuration.
        texts: writes configurations.
    """

    def __init__(
        self,
        roots: Roots,
        runs: RunService,
        exports: Exports,
        store: ConfigStore,
        texts: ConfigTexts,
    ) -> None:
        self._roots = roots
        self._runs = runs
        self._exports = exports
        self._store = store
        self._texts = texts

    def text(self, request: CommandRequest) -> CommandText:
        """The command.

        Raises:
            WebError: there is no such run, dataset or export.
            BadInputError: a name or an address cannot be used.
        """
        return CommandText(text=self._text(request.command))

    def _text(self, asked: Any) -> str:
        if isinstance(asked, c.StartCommand):
            return self._start(asked.run)
        if isinstance(asked, c.RunCommand):
            return self._of_run(asked.do, asked.run_id)
        if isinstance(asked, c.CompareRunsCommand):
            return _joined("runs", "compare", *map(self._folder, asked.run_ids))
        if isinstance(asked, c.RecordAgainCommand):
            out = self._roots.destination(asked.dataset)
            options = self._runs.options(asked.run_id)
            return self._record(self._runs.settings(asked.run_id), out, options)
        if isinstance(asked, c.RenameRunCommand):
            return _joined("runs", "rename", *self._run(asked.run_id), asked.name)
        if isinstance(asked, c.DatasetCommand):
            place = str(self._roots.dataset(asked.dataset).path)
            if asked.do == "delete-dataset":
                return _joined("dataset", "delete", place, "--yes")
            return _joined(asked.do, place)
        if isinstance(asked, c.RenameDatasetCommand):
            place = str(self._roots.dataset(asked.dataset).path)
            return _joined("dataset", "rename", place, asked.name)
        if isinstance(asked, c.ExportCommand):
            return self._export(asked.dataset, asked.export)
        place = str(self._exports.place(asked.name))
        if isinstance(asked, c.KeptExportCommand):
            return _joined("dataset", "delete", place, "--yes")
        return shlex.join(["mv", "-nT", "--", place, str(self._roots.exports(asked.new_name))])

    def _start(self, asked: RunStart) -> str:
        from carstage.runs.launching import RunOptions

        document = self._store.state().config if asked.config is None else asked.config
        work = str(self._roots.work(asked.work)) if asked.work else None
        options = RunOptions(asked.retries, asked.append, asked.workers, asked.catalog, work)
        return self._record(document, self._roots.destination(asked.dataset), options)

    def _record(self, document: Document, out: DatasetPath, options: RunOptions) -> str:
        return self._reading(document, "run", "-", "--out", str(out), *options.arguments())

    def _reading(self, document: Document, *parts: str) -> str:
        """A command that reads a configuration from standard input."""
        text = self._texts.write(ConfigExportRequest(config=document)).text.rstrip("\n")
        if _END in text.splitlines():  # nobody names anything so; JSON has no such line
            text = json.dumps(document, ensure_ascii=False)
        return f"{_joined(*parts)} <<'{_END}'\n{text}\n{_END}"

    def _of_run(self, do: str, run_id: str) -> str:
        if do == "delete-run":
            return _joined("runs", "delete", *self._run(run_id), "--yes")
        if do == "stop":
            return _joined("runs", "stop", *self._run(run_id))
        if do == "campaign-report":
            place, settings = self._place_of(run_id), self._runs.settings(run_id)
            return self._reading(settings, "campaign", "report", str(place), "-")
        options = self._runs.options(run_id)
        given = options.arguments()
        if self._runs.folder(run_id) is None:  # refused before it made a folder
            place = self._place_of(run_id)
            return self._record(self._runs.settings(run_id), place, options)
        return _joined("runs", "resume", str(self._place_of(run_id)), run_id, *given)

    def _folder(self, run_id: str) -> str:
        self._runs.summary(run_id)
        folder = self._runs.folder(run_id)
        if folder is None:
            raise WebError(409, f"Run {run_id} has made no folder.", "Leave it out.")
        return str(folder)

    def _run(self, run_id: str) -> list[str]:
        """How a run is named on the command line."""
        work = self._runs.options(run_id).work
        return [str(self._place_of(run_id)), run_id, *(["--work", work] if work else [])]

    def _place_of(self, run_id: str) -> DatasetPath:
        from carstage.storage.address import dataset_root

        return dataset_root(self._runs.summary(run_id).location)

    def _export(self, dataset: str, asked: ExportRequest) -> str:
        from carstage.exporters.options import ExportOptions, flag_of

        found = self._roots.dataset(dataset)
        out = self._roots.exports(export_name(found, asked))
        given = []
        for option in fields(ExportOptions):
            value = getattr(asked, option.name, None)
            if value in (None, False, []):
                continue
            flag = flag_of(option)
            for one in value if isinstance(value, list) else [value]:
                given += [flag] if one is True else [flag, str(one)]
        given += ["--overwrite"] if asked.overwrite else []
        given += ["--allow-incomplete"] if asked.allow_incomplete else []
        return _joined("export", asked.format, str(found.path), str(out), *given)


def _joined(*parts: str) -> str:
    return shlex.join(["carstage", *parts])
