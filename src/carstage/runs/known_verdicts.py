"""Verdicts on the embedded simulator that this machine has come to before.

Its code is known, and so is the code that records and judges it. What it draws with is one of the
machine's cards or none. While all that is the same, the self-test would say the same again.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from carstage.cache import cache_folder, keep_in_cache
from carstage.config import Config
from carstage.config.servers import EmbeddedServerConfig
from carstage.selftest import Verdict
from carstage.server import ClientPython, code_fingerprint

_CARDS = ((Path("/dev"), "nvidia*"), (Path("/sys/class/drm"), "card*"))


def verdict_file(config: Config, client: ClientPython) -> Path | None:
    """Where the verdict on a configuration's server is kept; None: such a server is tested anew.

    Args:
        config: only its ``server`` section matters.
        client: the Python that records.
    """
    server = config.server
    if not isinstance(server, EmbeddedServerConfig) or server.self_test != "auto":
        return None
    cards = sorted(card.name for folder, names in _CARDS for card in folder.glob(names))
    words = (
        *(code_fingerprint("carstage"), server.carla_version),
        *(str(client.path), client.client, *cards),
    )
    digest = hashlib.sha256("\n".join(words).encode()).hexdigest()
    return cache_folder() / f"self-test-{digest[:16]}.json"


def known_verdict(file: Path | None) -> Verdict | None:
    """The verdict that is kept in a file; None where there is none."""
    try:
        found = None if file is None else Verdict.from_json(json.loads(file.read_bytes()))
    except (OSError, ValueError, KeyError, TypeError):
        return None  # not there yet, or not whole: the test is made anew
    return found if found is not None and found.ok else None


def keep_verdict(file: Path | None, verdict: Verdict) -> None:
    """Keep a verdict for the next run, unless a check fails."""
    if file is not None and verdict.ok:
        keep_in_cache(file, json.dumps(verdict.to_json()))
