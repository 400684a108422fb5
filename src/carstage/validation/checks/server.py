"""Was the server sound that an episode was recorded on?"""

from __future__ import annotations

from carstage.dataset.reading import Episode
from carstage.validation.checks.findings import Findings


def check_self_test(episode: Episode, findings: Findings) -> None:
    """Warn of every check of the self-test that the server did not pass before the run."""
    verdict = episode.marker.self_test
    if verdict is None:
        return
    try:
        failed = [
            f"CARLA {verdict['server']} failed the self-test's check of {check['name']}: "
            f"{check['found']}; expected: {check['expected']}"
            for check in verdict["checks"]
            if not check["ok"]
        ]
    except (KeyError, TypeError) as error:
        failed = [f"what the marker says of the self-test is damaged: {error!r}"]
    for message in failed:
        findings.add("self_test", message, severity="warning")
