"""One run per server."""

from pathlib import Path
from typing import Any

import pytest

from carstage.config import Config, check_config
from carstage.errors import BadInputError
from carstage.runs.server_lock import server_lock


def config(**server: Any) -> Config:
    return check_config({"server": server})


def test_a_server_serves_one_run_at_a_time(tmp_path: Path) -> None:
    remote, local = config(kind="remote", port=2000), config(kind="remote", host="localhost")
    with server_lock(remote, tmp_path):
        with pytest.raises(BadInputError, match=r"127\.0\.0\.1:2000"), server_lock(local, tmp_path):
            pass
        with server_lock(config(kind="remote", port=2002), tmp_path):
            pass
    with server_lock(local, tmp_path):
        pass


def test_servers_on_ports_of_their_own_need_no_lock(tmp_path: Path) -> None:
    with server_lock(config(kind="embedded"), tmp_path), server_lock(config(), tmp_path):
        assert list(tmp_path.iterdir()) == []
