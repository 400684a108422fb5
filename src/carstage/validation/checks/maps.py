"""Whether the dataset has the towns' OpenDRIVE texts that its episodes name."""

from __future__ import annotations

import re

from carstage.dataset.reading import Episode
from carstage.errors import DatasetError
from carstage.validation.checks.findings import Findings

_SPACE = re.compile(r"\s*")
_ROOT = re.compile(r"<OpenDRIVE[\s>]")
_BEFORE_ROOT = {"<?": "?>", "<!--": "-->"}
"""What may stand before a document's root, and how it ends."""


class MapChecks:
    """Reads each text once, however many episodes name it."""

    def __init__(self) -> None:
        self._verdicts: dict[str, str | None] = {}

    def check(self, episode: Episode, findings: Findings) -> None:
        """The text is there, is the one that was committed and asked for, is OpenDRIVE."""
        try:
            named, wanted = episode.document.get("opendrive"), episode.spec.opendrive
        except DatasetError:
            return  # the checks of the episode say so
        if wanted not in (None, named):
            findings.add("map", "the map is not the file that the specification names")
        if named is None:
            return
        key = repr(named)  # a dataset from elsewhere may name it by anything
        if key not in self._verdicts:
            self._verdicts[key] = _verdict(episode)
        verdict = self._verdicts[key]
        if verdict is not None:
            findings.add("map", verdict)


def _verdict(episode: Episode) -> str | None:
    try:
        text = episode.opendrive()
    except DatasetError as error:
        return str(error)
    if text is None or not _is_opendrive(text):
        return "the text of the map is no OpenDRIVE document"
    return None


def _is_opendrive(text: str) -> bool:
    """Whether an XML document's root is OpenDRIVE's; in one pass over what stands before it."""
    at = _end_of_space(text, 0)
    while (end := _end_of_preamble(text, at)) is not None:
        at = _end_of_space(text, end)
    return _ROOT.match(text, at) is not None


def _end_of_preamble(text: str, at: int) -> int | None:
    """Where a declaration or a comment that begins at a place ends; None: none begins, or ends."""
    for begin, end in _BEFORE_ROOT.items():
        if text.startswith(begin, at):
            found = text.find(end, at + len(begin))
            return None if found < 0 else found + len(end)
    return None


def _end_of_space(text: str, at: int) -> int:
    space = _SPACE.match(text, at)
    return at if space is None else space.end()
