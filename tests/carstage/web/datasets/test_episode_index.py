"""What lists say of episodes is kept, whoever asks at the same time."""

import threading
from pathlib import Path

import pytest

from carstage.files.whole import write_whole
from carstage.web.datasets import episode_index
from carstage.web.datasets.episode_index import EpisodeIndex
from sites import Site

pytestmark = pytest.mark.xdist_group("web")  # one site for all


def test_requests_that_keep_the_index_take_turns(
    site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (marker,) = (site.root / "town" / "commits").iterdir()
    file, inside, meetings = tmp_path / "episodes.json", threading.Semaphore(1), list[str]()
    first_is_inside, go_on = threading.Event(), threading.Event()

    def slow(path: Path, content: bytes) -> None:
        if path != file:  # the site's own
            write_whole(path, content)
            return
        if not inside.acquire(blocking=False):
            meetings.append("two write the same hidden file")
            return
        first_is_inside.set()
        go_on.wait(0.5)  # long enough for the second to come in, if nothing kept it out
        write_whole(path, content)
        inside.release()

    monkeypatch.setattr(episode_index, "write_whole", slow)
    index = EpisodeIndex(file)
    facts = index.facts(marker, 0.0)
    first = threading.Thread(target=index.save)
    first.start()
    assert first_is_inside.wait(10.0)
    renamed = marker.with_name("other.json")
    renamed.write_bytes(marker.read_bytes())
    try:
        index.facts(renamed, 0.0)
        second = threading.Thread(target=index.save)
        second.start()
        second.join(10.0)
        go_on.set()
        first.join(10.0)
    finally:
        renamed.unlink()
    assert not meetings
    kept = EpisodeIndex(file)
    monkeypatch.setattr(episode_index, "_read", lambda path: pytest.fail(f"{path} is read again"))
    assert kept.facts(marker, 0.0) == facts
