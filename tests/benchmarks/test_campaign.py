"""A campaign is as good as its parts."""

from __future__ import annotations

import json

from benchmarks.campaign import Campaign
from carstage.bench.verdict import Figure, Verdict


def test_a_campaign_is_good_when_all_its_parts_are() -> None:
    good, bad = Verdict("a", (Figure("x", 1, "<=", 2),)), Verdict("b", (Figure("y", 3, "<=", 2),))
    assert Campaign("demo", {"a": good}).ok
    assert not Campaign("demo", {}).ok
    campaign = Campaign("demo", {"a": good, "b": bad})
    assert not campaign.ok
    assert json.loads(campaign.json())["parts"]["b"]["figures"]["y"]["value"] == 3
    assert campaign.text().splitlines()[1:] == ["  a: ok", "  b: FAILED (y)"]
