"""Whether the dataset has the towns' OpenDRIVE texts that its episodes name."""

from __future__ import annotations

import re

from carstage.dataset.reading import Episode
from carstage.errors import DatasetError
from carstage.validation.checks.findings import Findings

_ROOT = re.compile(r"\s*(<\?xml.*?\?>)?\s*(<!--.*?-->\s*)*<OpenDRIVE[\s>]", re.DOTALL)


class MapChecks:
    """Reads each text once, however many episodes name it."""

    def __init__(self) -> None:
        self._verdicts: dict[str, str | None] = {}

    def check(self, episode: Episode, findings: Findings) -> None:
        """The text is there, is the one that was committed, is OpenDRIVE."""
        try:
            named = episode.document.get("opendrive")
        except DatasetError:
            return  # the checks of the episode say so
        if named is None:
            return
        if named not in self._verdicts:
            self._verdicts[named] = _verdict(episode)
        verdict = self._verdicts[named]
        if verdict is not None:
            findings.add("map", verdict)


def _verdict(episode: Episode) -> str | None:
    try:
        text = episode.opendrive()
    except DatasetError as error:
        return str(error)
    if text is None or not _ROOT.match(text):
        return "the text of the map is no OpenDRIVE document"
    return None
