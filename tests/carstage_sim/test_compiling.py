"""The process that compiles what draws pictures while the server makes its town."""

from __future__ import annotations

import logging
import os

import psutil
import pytest

from carstage_sim import compiling
from carstage_sim.compiling import COMPILING_LOG, PicturesCompiled
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.picture import PictureMaker
from carstage_sim.render.scene import SceneStore
from waiting import await_that

pytestmark = pytest.mark.xdist_group("kernels")
TWO_CORES = len(os.sched_getaffinity(0)) > 1


def no_mesh(key: str) -> object:
    raise KeyError(key)


@pytest.fixture(scope="module", autouse=True)
def compiled_before() -> None:
    caster = RayCaster(1)
    PictureMaker(caster).warm_up_rays(SceneStore(None, no_mesh, cache=None))  # type: ignore[arg-type]
    caster.close()


@pytest.fixture
def missing(monkeypatch: pytest.MonkeyPatch) -> None:
    if not TWO_CORES:
        pytest.skip("on one core there is nothing to gain, and no process")
    assert compiling._is_compiled()
    monkeypatch.setattr(compiling, "_is_compiled", lambda: False)


def children() -> list[psutil.Process]:
    return [
        child
        for child in psutil.Process().children()
        if "carstage_sim.compiling" in child.cmdline()
    ]


def started_child() -> psutil.Process:
    """The one that compiles; for a moment after its start it has no command line yet."""
    await_that(lambda: bool(children()))
    (child,) = children()
    return child


def test_nothing_is_started_where_the_code_is_there() -> None:
    with PicturesCompiled() as compiled:
        assert children() == []
        compiled.wait()


def test_a_process_compiles_and_who_waits_is_told(
    missing: None, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, COMPILING_LOG), PicturesCompiled() as compiled:
        assert started_child().is_running()
        compiled.wait()
        assert children() == []
    first, last = caplog.messages
    assert first.startswith("compiling what draws pictures")
    assert last.startswith("compiled in")


def test_the_process_ends_with_the_block(missing: None) -> None:
    with PicturesCompiled():
        child = started_child()
    assert not child.is_running()


def test_the_process_ends_when_the_server_is_gone(missing: None) -> None:
    with PicturesCompiled() as compiled:
        child = started_child()
        assert compiled._process is not None
        assert compiled._process.stdin is not None
        compiled._process.stdin.close()
        await_that(lambda: compiled._process is not None and compiled._process.poll() is not None)
        assert not child.is_running()


def test_a_process_that_fails_leaves_the_work_to_the_server(
    missing: None, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, COMPILING_LOG), PicturesCompiled() as compiled:
        child = started_child()
        child.kill()
        compiled.wait()
    assert "ended with -9: the server compiles" in caplog.text
