"""The documentation's tables are the schema's."""

from __future__ import annotations

from pathlib import Path

from carstage.annotation.schema import TABLES, markdown

PAGE = Path(__file__).parents[3] / "docs" / "formats" / "dataset.md"
MARKER = "<!-- columns: generated -->\n"


def test_the_page_holds_the_generated_tables() -> None:
    """On failure: replace what follows the marker by `python -m carstage.annotation.schema`."""
    _, found, generated = PAGE.read_text(encoding="utf-8").partition(MARKER)
    assert found, "the page has lost its marker"
    assert generated.strip() == markdown().strip()


def test_tables_begin_with_their_keys_and_name_columns_once() -> None:
    for columns in TABLES.values():
        names = [column.name for column in columns]
        assert names[:2] == ["k", "timestamp_s"]
        assert names[2] in ("track_id", "sensor_id")
        assert len(set(names)) == len(names)
    assert TABLES["camera_objects.parquet"][3].name == "sensor_id"


def test_units_of_names_agree_with_the_schema() -> None:
    suffixes = {"_deg": "deg", "_m": "m", "_s": "s", "_kmh": "km/h"}
    for columns in TABLES.values():
        for column in columns:
            for suffix, unit in suffixes.items():
                if column.name.endswith(suffix):
                    assert column.unit == unit, column.name


def test_descriptions_do_not_break_a_markdown_table() -> None:
    for columns in TABLES.values():
        assert not any("|" in column.description + column.unit for column in columns)
