"""Object stores: the contract of all stores on real servers, and what is refused before a run."""

from __future__ import annotations

import os
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from carstage import Dataset
from carstage.errors import BadInputError, DatasetError, StoreAccessError, UnsafeStoreError
from carstage.storage import Store, open_store
from carstage.storage.remote_files import remote_files
from carstage.testing.store import StoreTests
from gcs_server import fake_gcs, fake_gcs_is_here
from object_stores import (
    ObjectServer,
    azurite,
    azurite_is_here,
    localbucket,
    moto,
    nanio,
)

pytestmark = pytest.mark.xdist_group("object stores")  # one server of each kind

Server = Callable[[Path], AbstractContextManager[ObjectServer]]


@pytest.fixture
def use(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[ObjectServer], str]:
    """Sets the environment of a server; gives an empty place in its bucket."""

    def of(server: ObjectServer) -> str:
        for name in os.environ:
            if name.startswith(("AWS_", "AZURE_", "AZURITE_", "GOOGLE_")):
                monkeypatch.delenv(name)
        for name, value in server.environment.items():
            monkeypatch.setenv(name, value)
        remote_files.cache_clear()
        return f"{server.address}/{tmp_path.name}/dataset"

    return of


@pytest.fixture(scope="module")
def moto_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ObjectServer]:
    with moto(tmp_path_factory.mktemp("moto")) as server:
        yield server


@pytest.fixture(scope="module")
def localbucket_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ObjectServer]:
    with localbucket(tmp_path_factory.mktemp("localbucket")) as server:
        yield server


@pytest.fixture(scope="module")
def azurite_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ObjectServer]:
    with azurite(tmp_path_factory.mktemp("azurite")) as server:
        yield server


class ObjectStoreTests(StoreTests):
    """The contract on a real server."""

    @pytest.fixture(autouse=True)
    def _reached(self, server: ObjectServer, use: Callable[[ObjectServer], str]) -> Iterator[None]:
        self.address = use(server)
        yield
        remote_files.cache_clear()

    def open(self, place: Path) -> Store:
        del place
        return open_store(self.address)

    def test_a_commit_removes_the_leases_of_its_episode(self, store: Store) -> None:
        attempt = store.reserve_attempt("0123456789abcdef", {"run_id": "r"})
        self.write(store, attempt)
        store.commit("0123456789abcdef", attempt, frames=1, versions={})
        assert remote_files(self.address).below("leases") == []

    def test_leases_that_a_killed_commit_left_are_forgotten(self, store: Store) -> None:
        self.write(store, "a1")
        store.commit("0123456789abcdef", "a1", frames=1, versions={})
        store.reserve_attempt("0123456789abcdef", {})
        store.reserve_attempt("fedcba9876543210", {})  # which somebody may be recording
        store.forget_leases(store.committed().keys())
        kept = [one.key for one in remote_files(self.address).below("leases")]
        assert kept == ["leases/fedcba9876543210.1"]

    def test_the_probe_leaves_nothing_behind(self, store: Store) -> None:
        store.check()
        assert [found.key for found in remote_files(self.address).below("")] == ["dataset.json"]

    def test_another_format_version_is_refused(self, store: Store) -> None:
        remote_files(self.address).write("dataset.json", b'{"format_version": 99}')
        with pytest.raises(DatasetError, match="format version 99"):
            store.initialise("test")

    def test_a_place_without_a_dataset_is_none(self) -> None:
        with pytest.raises(DatasetError, match="no Car-STAGE dataset"):
            Dataset(f"{self.address}/nothing")


class TestMoto(ObjectStoreTests):
    @pytest.fixture
    def server(self, moto_server: ObjectServer) -> ObjectServer:
        return moto_server


class TestLocalBucket(ObjectStoreTests):
    @pytest.fixture
    def server(self, localbucket_server: ObjectServer) -> ObjectServer:
        return localbucket_server


@pytest.mark.skipif(not azurite_is_here(), reason="run `npm ci` in tests/services for Azurite")
class TestAzurite(ObjectStoreTests):
    @pytest.fixture
    def server(self, azurite_server: ObjectServer) -> ObjectServer:
        return azurite_server


@pytest.fixture(scope="module")
def gcs_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ObjectServer]:
    with fake_gcs(tmp_path_factory.mktemp("gcs")) as server:
        yield server


@pytest.mark.skipif(not fake_gcs_is_here(), reason="the dev extra's fake-gcs-server is missing")
class TestGoogle(ObjectStoreTests):
    @pytest.fixture
    def server(self, gcs_server: ObjectServer) -> ObjectServer:
        return gcs_server


@pytest.fixture(scope="module")
def careless(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ObjectServer]:
    """A server that looks at credentials and heeds no condition."""
    pytest.importorskip("nanio", reason="nanio needs Python 3.11")
    with nanio(tmp_path_factory.mktemp("nanio")) as server:
        yield server


def test_a_store_that_replaces_what_exists_is_refused(
    careless: ObjectServer, use: Callable[[ObjectServer], str]
) -> None:
    address = use(careless)
    with pytest.raises(UnsafeStoreError, match="silently replaces"):
        open_store(address).check()
    assert remote_files(address).below("") == []


def test_wrong_credentials_are_told_without_them(
    careless: ObjectServer,
    use: Callable[[ObjectServer], str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    address = use(careless)
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "not-the-right-one")
    with pytest.raises(StoreAccessError, match="refuses the credentials") as caught:
        open_store(address).check()
    assert caught.value.exit_code == 2
    assert "AWS_SECRET_ACCESS_KEY" in caught.value.hint
    told = repr(caught.value) + str(caught.value.__cause__) + str(caught.value.__context__)
    assert "not-the-right-one" not in told
    assert "Signature=" not in told


@pytest.mark.parametrize("server", [moto, localbucket])
def test_a_bucket_that_is_not_there_is_told(
    server: Server, tmp_path: Path, use: Callable[[ObjectServer], str]
) -> None:
    with server(tmp_path / "server") as running:
        use(running)
        with pytest.raises(StoreAccessError, match="there is no such bucket"):
            open_store("s3://another-bucket/x").check()


def test_without_credentials_it_says_so(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    careless: ObjectServer,
    use: Callable[[ObjectServer], str],
) -> None:
    address = use(careless)
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("AWS_METADATA_ENDPOINT", "http://127.0.0.1:9")
    with pytest.raises(StoreAccessError, match="no credentials were found"):
        open_store(address).check()


def test_the_profile_of_amazons_tools_is_used(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    careless: ObjectServer,
    use: Callable[[ObjectServer], str],
) -> None:
    address = use(careless)
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    (tmp_path / ".aws").mkdir()
    (tmp_path / ".aws" / "credentials").write_text(
        "[work]\naws_access_key_id = user\naws_secret_access_key = secret-of-nanio\n"
    )
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("AWS_PROFILE", "work")
    with pytest.raises(UnsafeStoreError):  # it was let in
        open_store(address).check()


def test_a_server_that_is_gone_is_told_in_time(
    tmp_path: Path, use: Callable[[ObjectServer], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("carstage.storage.remote_files._RETRIES", 1)
    monkeypatch.setattr("carstage.storage.remote_files._TRIES", 2)
    with localbucket(tmp_path / "server") as server:
        address = use(server)
    with pytest.raises(Exception, match="cannot be reached") as caught:
        open_store(address).check()
    assert not isinstance(caught.value, BadInputError)


def test_an_address_may_not_hold_credentials() -> None:
    with pytest.raises(BadInputError, match="a bucket and a path alone") as caught:
        open_store("s3://user:secret@bucket/x")
    assert "secret" not in str(caught.value)


def test_a_lost_answer_to_a_commit_does_not_lose_the_episode(
    tmp_path: Path, use: Callable[[ObjectServer], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The marker was made, and the answer did not come: it is ours all the same."""
    import obstore

    with localbucket(tmp_path / "server") as server:
        store = open_store(use(server))
        store.initialise("test")
        attempt = store.reserve_attempt("0123456789abcdef", {})
        with store.attempt_files("0123456789abcdef", attempt).stream() as stream:
            stream.write("episode.json", b"{}")
        put, lost = obstore.put, []

        def put_and_lose(*given: object, **options: object) -> object:
            answer = put(*given, **options)  # type: ignore[arg-type]
            if options.get("mode") == "create" and not lost:
                lost.append(answer)
                raise obstore.exceptions.GenericError("timed out")
            return answer

        monkeypatch.setattr(obstore, "put", put_and_lose)
        marker = store.commit("0123456789abcdef", attempt, frames=1, versions={})
        assert lost
        assert store.committed() == {"0123456789abcdef": marker}


def test_the_bucket_is_asked_by_nobody_but_its_own_port(
    tmp_path: Path, use: Callable[[ObjectServer], str]
) -> None:
    with localbucket(tmp_path / "server") as server:
        use(server)
        assert urllib.request.urlopen(f"http://127.0.0.1:{server.port}/").status == 200
