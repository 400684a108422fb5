"""Which database a catalog is, and that nobody sees a password."""

from __future__ import annotations

from pathlib import Path

import pytest

from carstage.cache import CACHE_VARIABLE
from carstage.catalog import CATALOG_VARIABLE, catalog_address
from carstage.catalog.address import location_of, masked, own_catalog, parse_address
from carstage.errors import BadInputError
from carstage.storage import RemotePath

SECRET = "s3cr3t"


@pytest.mark.parametrize(
    ("text", "file"),
    [
        ("catalog.sqlite", "catalog.sqlite"),
        ("/data/my catalog.db", "/data/my catalog.db"),
        ("sqlite:///catalog.db", "catalog.db"),
        ("sqlite:////data/catalog.db", "/data/catalog.db"),
    ],
)
def test_a_path_is_an_sqlite_file(text: str, file: str) -> None:
    address = parse_address(text, secret=False)
    assert (address.kind, address.file) == ("sqlite", Path(file))
    assert address.shown == file


@pytest.mark.parametrize("scheme", ["postgresql", "postgres", "postgresql+psycopg", "PostgreSQL"])
def test_every_way_of_writing_postgresql_is_understood(scheme: str) -> None:
    address = parse_address(f"{scheme}://user@host:5433/name", secret=False)
    assert address.kind == "postgresql"
    assert address.shown == "postgresql://user@host:5433/name"


@pytest.mark.parametrize("text", ["mysql://u@h/d", "sqlite://", "sqlite:///", "s3://bucket/x"])
def test_other_databases_are_refused_by_name(text: str) -> None:
    with pytest.raises(BadInputError, match=text.partition(":")[0]):
        parse_address(text, secret=True)


@pytest.mark.parametrize(
    "text",
    [
        f"postgresql://user:{SECRET}@host/name",
        f"postgresql://:{SECRET}@host/name",
        f"postgresql://host/name?user=u&password={SECRET}",
        f"postgresql://host/name?sslpassword={SECRET}&user=u",
    ],
)
def test_a_password_is_for_the_environment_alone(
    text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(BadInputError, match="holds a password") as caught:
        catalog_address(text)
    assert SECRET not in str(caught.value)
    monkeypatch.setenv(CATALOG_VARIABLE, text)
    address = catalog_address(None)
    assert SECRET in address.url
    for shown in (address.shown, repr(address), address.without_secrets(f"failed: {text}")):
        assert SECRET not in shown
    assert SECRET not in masked(text)


def test_what_is_given_comes_before_the_environment_and_that_before_the_datasets_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert catalog_address(None, tmp_path).file == tmp_path / "catalog.sqlite"
    monkeypatch.setenv(CATALOG_VARIABLE, "named.sqlite")
    assert catalog_address(None, tmp_path).file == Path("named.sqlite")
    assert catalog_address("given.sqlite", tmp_path).file == Path("given.sqlite")


def test_without_a_dataset_a_catalog_has_to_be_named() -> None:
    with pytest.raises(BadInputError, match="No catalog is named"):
        catalog_address(None)


def test_the_catalog_of_a_dataset_elsewhere_is_in_the_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    places = [RemotePath("s3://bucket/one"), RemotePath("s3://bucket/two")]
    files = [own_catalog(place).file for place in places]
    assert [file.parent for file in files if file] == [tmp_path / "catalogs"] * 2
    assert files[0] != files[1]
    assert location_of(places[0], own_catalog(places[0])) == "s3://bucket/one"


def test_a_folder_has_one_location_however_it_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset = tmp_path / "dataset"
    (tmp_path / "here").mkdir()
    dataset.mkdir()
    monkeypatch.chdir(tmp_path / "here")
    shared = parse_address(str(tmp_path / "shared.sqlite"), secret=False)
    named = Path("../dataset")
    assert location_of(named, shared) == location_of(dataset, shared) == str(dataset)
    own = parse_address(str(dataset / "catalog.sqlite"), secret=False)
    assert location_of(named, own) == location_of(dataset, own_catalog(named)) == "."
