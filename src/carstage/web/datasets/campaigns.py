"""How far campaigns are in a dataset: what ``carstage campaign report`` says, for the page."""

from __future__ import annotations

import json
import threading
from collections import OrderedDict

from carstage.errors import ConfigError
from carstage.web.messages import CampaignAxis, CampaignList, CampaignMessage
from carstage.web.messages.base import Document
from carstage.web.roots import Roots
from carstage.web.runs.service import RunService
from carstage.web.wording import title_of

_MOST_SHOWN = 5
_MOST_KEPT = 20
_Key = tuple[str, str, str]


class CampaignService:
    """Reports on campaigns; keeps the last ones while their dataset stays as it is.

    Args:
        roots: where the datasets are.
        runs: know by which configurations they were filled.
    """

    def __init__(self, roots: Roots, runs: RunService) -> None:
        self._roots = roots
        self._runs = runs
        self._lock = threading.Lock()
        self._kept: OrderedDict[_Key, CampaignMessage] = OrderedDict()

    def all(self, dataset: str) -> CampaignList:
        """The campaigns of a dataset, one for each configuration, the newest first.

        Raises:
            WebError: there is no such dataset.
            DatasetError: a document or a label table of it is damaged.
        """
        self._roots.dataset(dataset)
        texts: dict[str, tuple[str, Document]] = {}
        for run_id, config in self._runs.configurations(dataset):
            if config.get("campaign"):
                texts.setdefault(json.dumps(config, sort_keys=True), (run_id, config))
        found, problems = [], []
        for text, (run_id, config) in list(texts.items())[:_MOST_SHOWN]:
            try:
                found.append(self._state(dataset, text, run_id, config))
            except ConfigError as error:  # of a version whose configurations are not read any more
                problems.append(f"The campaign of run {run_id} cannot be shown: {error.message}")
        return CampaignList(campaigns=found, problems=problems)

    def _state(self, dataset: str, text: str, run_id: str, config: Document) -> CampaignMessage:
        from carstage.config import check_config
        from carstage.dataset import Dataset
        from carstage.dataset.campaigns import campaign_state

        place = self._roots.dataset(dataset)
        key = dataset, place.fingerprint(), text
        with self._lock:
            kept = self._kept.get(key)
        if kept is not None:
            return kept.model_copy(update={"run_id": run_id})
        state = campaign_state(check_config(config), Dataset(place.path)).to_json()
        axes = [
            CampaignAxis(path=path, title=title_of(path), bins=bins)
            for path, bins in state.pop("dimensions").items()
        ]
        made = CampaignMessage.model_validate({**state, "run_id": run_id, "axes": axes})
        with self._lock:
            self._kept[key] = made
            while len(self._kept) > _MOST_KEPT:
                self._kept.popitem(last=False)
        return made
