"""Runs into a store that refuses, fills, or is away: what is said, what is kept, how it ends."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from benchmarks.framework.spoiling_proxy import Spoil, SpoilingProxy, Spoilt
from carstage.runs.interruption import END_S
from carstage.runs.pending import pending_recordings
from carstage.storage import open_store
from carstage.storage.remote_files import remote_files
from driving import (
    Command,
    carstage,
    children_that_live,
    command,
    events,
    wait_for,
    wait_for_event,
)
from object_stores import ObjectServer, localbucket, moto_that_looks_at_permissions

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("runs")]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ObjectServer]:
    with localbucket(tmp_path_factory.mktemp("localbucket")) as running:
        yield running


@pytest.fixture
def proxy(server: ObjectServer, monkeypatch: pytest.MonkeyPatch) -> Iterator[SpoilingProxy]:
    """Commands of the test reach the server through it; it spoils nothing yet."""
    with SpoilingProxy(server.port, lambda method, path: None).serving() as running:
        for name, value in server.environment.items():
            monkeypatch.setenv(name, value)
        monkeypatch.setenv("AWS_ENDPOINT_URL", running.url)
        remote_files.cache_clear()
        yield running
    remote_files.cache_clear()


@pytest.fixture
def look(server: ObjectServer, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], list[str]]:
    """Gives the keys below a place, whatever becomes of the proxy."""

    def keys(address: str) -> list[str]:
        with monkeypatch.context() as patch:
            for name, value in server.environment.items():
                patch.setenv(name, value)
            remote_files.cache_clear()
            found = [one.key for one in remote_files(address).below("")]
        remote_files.cache_clear()
        return found

    return keys


def always(method: str, answer: Spoilt, *, without: str = "nothing") -> Spoil:
    """Answers one kind of request."""
    wanted = {"LIST": "GET"}.get(method, method)

    def spoil(asked: str, path: str) -> Spoilt | None:
        is_listing = asked == "GET" and "list-type=" in path
        fits = asked == wanted and is_listing == (method == "LIST")
        return answer if fits and without not in path else None

    return spoil


DENIED = Spoilt("answered", 403, "AccessDenied")


@pytest.mark.parametrize("method", ["PUT", "GET", "LIST"])
def test_without_permission_nothing_is_started_and_nothing_left(
    method: str,
    proxy: SpoilingProxy,
    server: ObjectServer,
    look: Callable[[str], list[str]],
    small: str,
    home: Path,
    tmp_path: Path,
) -> None:
    proxy.spoil = always(method, DENIED)
    address, work = f"{server.address}/denied-{method}", tmp_path / "work"
    ended = carstage(["run", small, "--out", address, "--work", str(work)], home)
    assert ended.code == 2, ended.stderr
    assert "these credentials do not permit it (403, AccessDenied)" in ended.stderr
    assert "Permit listing, reading, writing and deleting" in ended.stderr
    assert not work.exists()
    assert look(address) == []


def test_a_store_that_may_not_be_cleared_up_is_refused(
    proxy: SpoilingProxy, server: ObjectServer, small: str, home: Path, tmp_path: Path
) -> None:
    """What it tried is left: nobody may remove it."""
    refused = {"DELETE": DENIED, "POST": DENIED}
    proxy.spoil = lambda method, path: refused.get(method)
    work = tmp_path / "work"
    ended = carstage(
        ["run", small, "--out", f"{server.address}/undeletable", "--work", str(work)], home
    )
    assert ended.code == 2, ended.stderr
    assert "do not permit it" in ended.stderr
    assert not work.exists()


def test_a_store_that_refuses_the_clock_is_named(
    proxy: SpoilingProxy, server: ObjectServer, small: str, home: Path, tmp_path: Path
) -> None:
    proxy.spoil = lambda method, path: Spoilt("answered", 403, "RequestTimeTooSkewed")
    work = tmp_path / "work"
    ended = carstage(["run", small, "--out", f"{server.address}/late", "--work", str(work)], home)
    assert ended.code == 2, ended.stderr
    assert f"{server.address}/late: the store refuses this machine's clock" in ended.stderr
    assert "(403, RequestTimeTooSkewed)" in ended.stderr
    assert not work.exists()


def test_a_user_without_permission_is_refused_by_a_store_that_looks(
    tmp_path: Path, small: str, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Moto judges by the user's policies, as Amazon does."""
    with moto_that_looks_at_permissions(tmp_path / "moto") as (running, users):
        codes = {}
        for name, environment in users.items():
            for variable, value in environment.items():
                monkeypatch.setenv(variable, value)
            remote_files.cache_clear()
            address, work = f"{running.address}/{name}", tmp_path / name
            if name == "writer":
                open_store(address).check()
                continue
            ended = carstage(["run", small, "--out", address, "--work", str(work)], home)
            codes[name] = (ended.code, "do not permit it (403, AccessDenied)" in ended.stderr)
            assert not work.exists()
        remote_files.cache_clear()
    assert codes == {"reader": (2, True), "nobody": (2, True)}


FULL = {
    "a quota": Spoilt("answered", 403, "QuotaExceeded"),
    "a full MinIO": Spoilt("answered", 507, "XMinioStorageFull"),
}


@pytest.mark.parametrize(("answer", "workers"), [("a quota", 1), ("a full MinIO", 2)])
def test_a_store_that_fills_ends_the_run_and_keeps_what_is_there(
    answer: str,
    workers: int,
    proxy: SpoilingProxy,
    server: ObjectServer,
    look: Callable[[str], list[str]],
    small: str,
    home: Path,
    tmp_path: Path,
) -> None:
    address = f"{server.address}/fills-{workers}-{answer.replace(' ', '-')}"
    given = ["run", small, "--out", address, "--work", str(tmp_path), "--set", "episodes=3"]
    given += ["--set", "duration_s=0.5", "--workers", str(workers)]
    with command(given, home) as running:
        first = wait_for_event(tmp_path, "episode_committed")["episode_id"]
        proxy.spoil = always("PUT", FULL[answer])
        ended = running.end()
    assert ended.code == 3, ended.stderr
    assert "the store is full" in ended.stderr
    assert "the same command again continues" in ended.stderr
    keys = look(address)
    kept = [key for key in keys if key.startswith("commits/")]
    assert f"commits/{first}.json" in kept
    assert len(kept) < 3
    committed = {key[len("commits/") : -len(".json")] for key in kept}
    assert episodes_in(keys) == committed | waiting_in(tmp_path)
    proxy.spoil = lambda method, path: None
    again = carstage([*given, "--json"], home)
    assert again.code == 0, again.stderr
    counts = json.loads(again.stdout.splitlines()[-1])["episodes"]
    assert counts["skipped"] == len(kept)
    assert counts["committed"] == 3 - len(kept)


def test_what_another_worker_has_recorded_when_the_store_fills_is_not_recorded_again(
    proxy: SpoilingProxy,
    server: ObjectServer,
    look: Callable[[str], list[str]],
    small: str,
    home: Path,
    tmp_path: Path,
) -> None:
    """One episode meets a full store; half of the other is there, and its answer is late."""
    late: list[str] = []

    def spoil(method: str, path: str) -> Spoilt | None:
        if method != "PUT" or "/sensors/" not in path:
            return None
        episode_id = path.partition("/episodes/")[2].partition("/")[0]
        if not late:
            late.append(episode_id)
        elif episode_id != late[0]:
            return FULL["a full MinIO"]
        return Spoilt("held") if path.endswith("000003.png") else None

    proxy.spoil = spoil
    address = f"{server.address}/fills-beside"
    given = ["run", small, "--out", address, "--work", str(tmp_path), "--set", "episodes=2"]
    given += ["--set", "duration_s=0.5", "--workers", "2"]
    ended = carstage(given, home)
    assert ended.code == 1, ended.stderr
    assert "the store is full" in ended.stderr
    assert "1 recorded episode not yet converted" in ended.stderr
    assert waiting_in(tmp_path) == episodes_in(look(address)) == set(late)
    proxy.spoil = lambda method, path: None
    again = carstage([*given, "--json"], home)
    assert again.code == 0, again.stderr
    assert f"Episode {late[0]} is recorded already" in again.stderr
    assert json.loads(again.stdout.splitlines()[-1])["episodes"]["committed"] == 2
    assert waiting_in(tmp_path) == set()


def episodes_in(keys: list[str]) -> set[str]:
    return {key.split("/")[1] for key in keys if key.startswith("episodes/")}


def waiting_in(work: Path) -> set[str]:
    """Episodes that are recorded and not yet converted: what of them is there stays."""
    return {one.episode_id for one in pending_recordings(work)}


def is_commit(method: str, path: str) -> bool:
    return method == "PUT" and "/commits/" in path


MOMENTS: dict[str, tuple[str, Callable[[str, str], bool]]] = {
    "before it starts": ("", lambda method, path: True),
    "while it records": ("tick", lambda method, path: True),
    "at the commit": ("episode_started", is_commit),
}
HOW = {"held": Spoilt("held"), "cut off": Spoilt("cut off")}
#: Less than one request alone may take, and far more than a run needs to end.
PATIENCE_S = 4 * END_S


def interrupt(running: Command, proxy: SpoilingProxy, how: str) -> None:
    """Press Ctrl-C once the store is away, and see that the command ends soon."""
    wait_for(lambda: proxy.spoilt[how], "a request that is spoilt")
    running.press_ctrl_c()
    _, said = running.process.communicate(timeout=PATIENCE_S)
    assert running.process.returncode == 130, said
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("moment", "how", "workers"),
    [
        ("before it starts", "held", 1),
        ("while it records", "held", 1),
        ("while it records", "cut off", 2),
        ("at the commit", "cut off", 1),
        ("at the commit", "held", 2),
    ],
)
def test_ctrl_c_ends_a_run_whose_store_is_away(
    moment: str,
    how: str,
    workers: int,
    proxy: SpoilingProxy,
    server: ObjectServer,
    look: Callable[[str], list[str]],
    small: str,
    home: Path,
    tmp_path: Path,
) -> None:
    """It ends while requests are held for ever, or are tried again; the next run completes it."""
    address = f"{server.address}/away-{moment}-{how}-{workers}".replace(" ", "-")
    given = ["run", small, "--out", address, "--work", str(tmp_path), "--json"]
    given += ["--workers", str(workers), "--set", "duration_s=1"]
    event, concerned = MOMENTS[moment]

    def away(method: str, path: str) -> Spoilt | None:
        return HOW[how] if concerned(method, path) else None

    if not event:
        proxy.spoil = away
    with command(given, home) as running:
        if event:
            wait_for_event(tmp_path, event)
            proxy.spoil = away
        interrupt(running, proxy, how)
    assert children_that_live(tmp_path) == []
    assert not [key for key in look(address) if key.startswith("commits/") and ".json" in key]
    recorded = [one["episode_id"] for one in events(tmp_path) if one["event"] == "episode_recorded"]
    proxy.spoil = lambda method, path: None
    again = carstage(given, home)
    assert again.code == 0, again.stderr
    assert json.loads(again.stdout.splitlines()[-1])["episodes"]["committed"] == 1
    if moment == "at the commit":
        assert recorded
        assert f"Episode {recorded[0]} is recorded already" in again.stderr
    keys = look(address)
    (marker,) = open_store(address).committed().values()
    prefix = f"episodes/{marker.episode_id}/{marker.attempt}/"
    assert sorted(prefix + one.path for one in marker.files) == [
        key for key in keys if key.startswith("episodes/")
    ]
    assert not [key for key in keys if key.startswith("leases/")]


def test_a_commit_whose_answer_is_never_heard_counts(
    proxy: SpoilingProxy,
    server: ObjectServer,
    look: Callable[[str], list[str]],
    small: str,
    home: Path,
    tmp_path: Path,
) -> None:
    """The marker is made, and the run ends before it can know: nothing of the episode is lost."""
    address = f"{server.address}/unheard"
    given = ["run", small, "--out", address, "--work", str(tmp_path), "--json"]
    given += ["--set", "duration_s=1"]
    made: list[str] = []

    def answers_stop(method: str, path: str) -> Spoilt | None:
        if made:
            return Spoilt("held")
        if not is_commit(method, path):
            return None
        made.append(path)
        return Spoilt("no answer")

    with command(given, home) as running:
        wait_for_event(tmp_path, "episode_started")
        proxy.spoil = answers_stop
        interrupt(running, proxy, "held")
    proxy.spoil = lambda method, path: None
    before = look(address)
    assert made[0].rpartition("/")[2] in [key.rpartition("/")[2] for key in before]
    again = carstage(given, home)
    assert again.code == 0, again.stderr
    assert json.loads(again.stdout.splitlines()[-1])["episodes"]["skipped"] == 1
    (marker,) = open_store(address).committed().values()
    listed = {f"episodes/{marker.episode_id}/a1/{one.path}" for one in marker.files}
    assert listed == {key for key in look(address) if key.startswith("episodes/")}
    assert not list((tmp_path / "runs").glob("*/raw"))
