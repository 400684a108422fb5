"""JSON of others: what ends the reading of one document ends nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from carstage.errors import DatasetError
from carstage.files.json_text import parse_json
from carstage.runs.reading import read_document
from carstage.storage.description import parse_description
from carstage.storage.marker import CommitMarker

HOSTILE = ["[" * 100_000, '{"a": 1e999}', '{"a": NaN}', f'{{"a": 1{"0" * 400}}}', "{"]


@pytest.mark.parametrize("text", HOSTILE)
def test_what_is_no_document_of_ours_is_a_value_error(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        parse_json(text)


def test_a_document_of_ours_is_read() -> None:
    assert parse_json(b'{"a": [1, -2.5e3, null, true]}') == {"a": [1, -2500.0, None, True]}


@pytest.mark.parametrize("text", HOSTILE)
def test_runs_markers_and_descriptions_of_others_are_damaged(tmp_path: Path, text: str) -> None:
    path = tmp_path / "status.json"
    path.write_text(text)
    assert read_document(path) is None
    with pytest.raises(DatasetError):
        CommitMarker.from_bytes(text.encode(), "m")
    with pytest.raises(DatasetError):
        parse_description(text.encode(), "d")
