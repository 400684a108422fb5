"""The commands of `carstage catalog`, from outside."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from typer.testing import CliRunner

from benchmarks.framework.postgres_servers import PASSWORD_IN_ADDRESS, PostgresServer
from carstage.catalog import CATALOG_VARIABLE, Catalog
from carstage.catalog.address import parse_address
from carstage.catalog.migrating import VERSION_TABLE
from carstage.cli.app import app
from small_episodes import add_episode

CLEAR, WET, NIGHT = "00000000000000c1", "00000000000000c2", "00000000000000c3"

pytestmark = pytest.mark.xdist_group("postgres")


def call(*words: str | Path, code: int = 0, **environment: str) -> Result:
    """Give a command in this process; a process of its own takes seconds to start."""
    done = CliRunner().invoke(app, ["catalog", *map(str, words)], env=environment)
    assert done.exit_code == code, done.output
    assert "Traceback" not in done.stderr
    return done


def json_of(*words: str | Path, code: int = 0, **environment: str) -> Any:
    return json.loads(call(*words, "--json", code=code, **environment).stdout.splitlines()[-1])


def test_from_a_dataset_to_pages_and_back(small: Path) -> None:
    assert json_of("rebuild", small)["written"] == 3
    assert (small / "catalog.sqlite").is_file()
    page = json_of("list", small, "--class", "car", "--limit", "1")
    assert [row["episode_id"] for row in page["episodes"]] == [CLEAR]
    page = json_of("list", small, "--class", "car", "--after", str(page["after"]))
    assert [row["episode_id"] for row in page["episodes"]] == [WET]
    assert json_of("show", small, WET)["map"] == "Stage02"
    assert "walker_adult" in call("show", small, WET).stdout
    listed = call("list", small, "--limit", "2")
    assert [line.split()[0] for line in listed.stdout.splitlines()] == ["episode_id", CLEAR, WET]
    assert "--after 2" in listed.stderr
    assert call("verify", small, "--deep").stdout == "3 episodes: 0 differences\n"
    (small / "episodes" / WET / "a1" / "ego.parquet").unlink()
    found = json_of("verify", small, code=1)
    assert [one["kind"] for one in found["differences"]] == ["missing"]


def test_what_may_only_be_read_can_be_read(tmp_path: Path) -> None:
    folder = tmp_path / "read? only#%41"
    add_episode(folder, CLEAR)
    call("rebuild", folder)
    # Root may write everywhere, unless it gives that up.
    without = [] if os.geteuid() else ["setpriv", "--bounding-set=-dac_override,-dac_read_search"]
    if without and shutil.which("setpriv") is None:
        pytest.skip("there is no setpriv to give up root's rights with")
    program = [*without, sys.executable, "-m", "carstage.cli", "catalog"]
    for path in (folder / "catalog.sqlite", folder):
        path.chmod(path.stat().st_mode & ~0o222)
    try:
        for words in (
            ["list", folder],
            ["show", folder, CLEAR],
            ["verify", folder],
            ["query", folder, "SELECT count(*) FROM episodes", "--index"],
        ):
            done = subprocess.run([*program, *words], capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stderr
        done = subprocess.run(
            [*program, "rebuild", folder], capture_output=True, text=True, check=False
        )
        assert done.returncode != 0
        assert "Traceback" not in done.stderr
    finally:
        folder.chmod(0o755)


def test_a_query_says_what_it_read(small: Path) -> None:
    words = "SELECT class, count(*) AS n FROM objects WHERE NOT is_ego GROUP BY class ORDER BY 1"
    found = json_of("query", small, words)
    assert found["rows"] == [
        {"class": "car", "n": 16},
        {"class": "truck", "n": 4},
        {"class": "walker_adult", "n": 20},
    ]
    assert found["files"] == 3
    assert found["bytes_read"] > 0
    call("rebuild", small)
    few = json_of("query", small, words, "--town", "Stage02")
    assert few["rows"] == [{"class": "car", "n": 4}, {"class": "walker_adult", "n": 20}]
    assert few["files"] == 1
    shown = subprocess.run(
        [sys.executable, "-m", "carstage.cli", "catalog", "query", small, words,
         "--town", "Stage02"],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    assert shown.stdout.splitlines()[0].split() == ["class", "n"]
    assert "1 files" in shown.stderr
    assert "leak" not in shown.stderr
    asked = json_of("query", small, "SELECT sum(frames) AS n FROM episodes", "--index")
    assert asked["rows"] == [{"n": 12}]


def test_columns_of_one_name_are_told_apart(small: Path) -> None:
    words = (
        "SELECT a.k, b.k, a.k, a.class AS k_2 FROM objects a JOIN objects b "
        "ON a.k = b.k ORDER BY ALL LIMIT 1"
    )
    found = json_of("query", small, words)
    assert found["columns"] == ["k", "k_1", "k_3", "k_2"]
    (row,) = found["rows"]
    assert (row["k"], row["k_1"], row["k_3"], row["k_2"]) == (0, 0, 0, "car")
    assert call("query", small, words).stdout.splitlines()[0].split() == found["columns"]


def test_numbers_of_a_query_are_numbers_of_json(small: Path) -> None:
    words = (
        "SELECT sum(k) AS whole, 2.50::DECIMAL(5, 2) AS part, 'nan'::DOUBLE AS none, "
        "['inf'::DOUBLE, 1.5] AS list, {'n': 1::HUGEINT} AS struct, DATE '2026-01-02' AS day "
        "FROM objects"
    )
    done = call("query", small, words, "--json").stdout.splitlines()[-1]
    assert "NaN" not in done
    assert "Infinity" not in done
    (row,) = json.loads(done)["rows"]
    assert isinstance(row.pop("whole"), int)
    assert row == {
        "part": 2.5,
        "none": None,
        "list": [None, 1.5],
        "struct": {"n": 1},
        "day": "2026-01-02",
    }


def test_the_index_takes_no_filters(small: Path) -> None:
    call("rebuild", small)
    words = ("SELECT count(*) FROM episodes", "--index", "--town", "Stage02")
    assert "filters do not apply" in call("query", small, *words, code=2).stderr


def test_left_over_attempts_are_listed_and_removed_on_request(small: Path) -> None:
    add_episode(small, CLEAR, attempt="a2", commit=False)
    add_episode(small, "00000000000000c9", commit=False)
    assert json_of("gc", small)["removed"] == 0
    assert (small / "episodes" / CLEAR / "a2").is_dir()
    done = json_of("gc", small, "--yes")
    assert [one["attempt"] for one in done["attempts"]] == ["a2"]
    assert not (small / "episodes" / CLEAR / "a2").exists()
    assert json_of("gc", small, "--older-than", "1h", "--yes")["attempts"] == []
    assert json_of("gc", small, "--older-than", "0s", "--yes")["removed"] == 1
    assert "no age" in call("gc", small, "--older-than", "soon", code=2).stderr
    assert call("gc", small).stdout == "Nothing is left over.\n"
    assert json_of("rebuild", small)["written"] == 3


def test_postgres_is_named_by_the_environment_and_its_password_shown_nowhere(
    small: Path, wheel_postgres: PostgresServer
) -> None:
    wheel_postgres.create("catalog")
    named = {CATALOG_VARIABLE: wheel_postgres.good_address}
    done = call("rebuild", small, **named)
    assert done.stdout.startswith("postgresql://writer:***@/catalog")
    assert PASSWORD_IN_ADDRESS not in done.stdout + done.stderr
    page = json_of("list", **named)
    assert [row["dataset"] for row in page["episodes"]] == [str(small)] * 3
    secret = {"PGPASSWORD": "p&ss/w%rd"}
    url = wheel_postgres.address()
    assert json_of("show", small, NIGHT, "--catalog", url, **secret)["weather"] == "ClearNight"
    assert not (small / "catalog.sqlite").exists()


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("{server}", "cannot be opened"),
        ("postgresql://nobody@127.0.0.1:1/x", "cannot be reached"),
        ("postgresql://u:secret@h/x", "holds a password"),
        ("mysql://h/x", "no database that Car-STAGE knows"),
    ],
)
def test_a_bad_catalog_is_bad_input(
    small: Path, wheel_postgres: PostgresServer, url: str, words: str
) -> None:
    given = url.format(server=wheel_postgres.address(database="nowhere"))
    done = call("rebuild", small, "--catalog", given, code=2, PGPASSWORD="p&ss/w%rd")
    assert words in done.stderr
    assert "secret" not in done.stderr


def test_a_run_is_refused_a_catalog_of_a_newer_schema_and_leaves_nothing(tmp_path: Path) -> None:
    file = tmp_path / "newer.sqlite"
    with (
        Catalog(parse_address(str(file), secret=False)) as catalog,
        catalog.writing() as connection,
    ):
        connection.exec_driver_sql(f"UPDATE {VERSION_TABLE} SET version_num = '9999'")
    config = tmp_path / "config.yaml"
    config.write_text("duration_s: 0.1\n")
    done = subprocess.run(
        [sys.executable, "-m", "carstage.cli", "run", config, "--out", tmp_path / "out",
         "--catalog", file],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert "newer Car-STAGE" in done.stderr
    assert not (tmp_path / "out").exists()


def test_without_a_catalog_the_way_to_one_is_said(small: Path) -> None:
    assert "carstage catalog rebuild" in call("list", small, code=2).stderr
    assert not (small / "catalog.sqlite").exists()
    assert CATALOG_VARIABLE in call("list", code=2).stderr


@pytest.mark.parametrize(
    ("package", "words", "extra"),
    [
        ("sqlalchemy", ("list", "DATASET"), "catalog"),
        ("alembic", ("rebuild", "DATASET"), "catalog"),
        ("psycopg", ("list", "--catalog", "postgresql://u@127.0.0.1:1/x"), "postgres"),
    ],
)
def test_a_package_that_is_missing_is_named(
    small: Path, package: str, words: tuple[str, ...], extra: str
) -> None:
    program = (
        f"import sys; sys.modules[{package!r}] = None; from carstage.cli import main; "
        "sys.argv[0] = 'carstage'; main()"
    )
    given = [str(small) if word == "DATASET" else word for word in words]
    done = subprocess.run(
        [sys.executable, "-c", program, "catalog", *given],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert f"carstage[{extra}]" in done.stderr
