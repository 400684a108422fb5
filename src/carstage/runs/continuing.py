"""Whether a run goes on with what a dataset holds, or would mix something else into it."""

from __future__ import annotations

import json
import platform
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from carstage import __version__
from carstage.config import check_config, dump_config
from carstage.errors import BadInputError, ConfigError
from carstage.packages import installed_version
from carstage.runs.reading import read_document
from carstage.storage import DatasetPath

#: Keys that say how much, where and by what means is recorded; episodes are the same without them.
_MEANS = frozenset(
    (
        *("name", "episodes", "supervision", "output", "conversion.mode", "conversion.workers"),
        *("server.port", "server.host", "server.path", "server.threads", "server.restart_every"),
        *("server.client_python", "server.create_client_env", "server.self_test"),
        *("campaign.quotas", "campaign.repeats"),
    )
)
#: Packages that compute what is in the files, or write their bytes.
_PACKAGES = ("deflate", "llvmlite", "numba", "numpy", "pillow", "pyarrow", "shapely")
_MOST_NAMED = 6


class OtherSettingsError(BadInputError):
    """A dataset holds episodes of other settings, another version or another environment."""


def environment_of(server: str, client: str) -> dict[str, str]:
    """What episodes are made with, by name and version.

    Args:
        server: version of CARLA that the server speaks.
        client: version of the client's wheel.
    """
    made_with = {"carstage": __version__, "server": server, "client": client}
    made_with["python"] = ".".join(platform.python_version_tuple()[:2])
    return made_with | {name: installed_version(name) for name in _PACKAGES}


def refuse_to_mix(
    dataset: DatasetPath,
    work: Path,
    present: Collection[str],
    planned: Collection[str] | None,
    settings: Mapping[str, Any],
    environment: Mapping[str, str] | None = None,
) -> None:
    """Refuse to record beside episodes of another kind.

    A dataset may have been recorded by several runs. It is enough that one of them was like this.

    Args:
        dataset: where it is, for messages.
        work: what holds the folder ``runs``. Runs of other machines are not known here.
        present: ids of the episodes that it holds.
        planned: ids of the episodes that this run is about; None: not known yet.
        settings: the run's configuration, as ``dump_config`` gives it.
        environment: of this run, as :func:`environment_of` gives it; None: not known yet.

    Raises:
        OtherSettingsError: no run that recorded one of the episodes was like this; says what
            differs from the most similar one.
    """
    if not present:
        return
    found = sorted(
        (differences(run, settings, environment) for run in _runs(work, present)), key=len
    )
    if found and not found[0]:
        return
    if not found and (planned is None or not set(planned).isdisjoint(present)):
        return  # nobody kept the runs' folders, but ids are of settings alone
    count = f"{len(present)} episode{'s' if len(present) > 1 else ''}"
    if found:
        named = "; ".join(found[0][:_MOST_NAMED])
        more = len(found[0]) - _MOST_NAMED
        why = f"recorded otherwise: {named}{f'; and {more} more' if more > 0 else ''}."
    else:
        why = "of other settings."
    raise OtherSettingsError(
        f"output: {dataset} holds {count} {why}",
        "Name another --out, or add --append to record into it all the same.",
    )


def differences(
    run: Mapping[str, Any], settings: Mapping[str, Any], environment: Mapping[str, str] | None
) -> list[str]:
    """What is otherwise now than in an earlier run, one phrase for each.

    Args:
        run: its ``plan.json``. Where that is of a version that kept no environment, the
            environment is not compared.
        settings: as ``dump_config`` gives them.
        environment: as :func:`environment_of` gives it; None: not compared.
    """
    found = []
    earlier_config = _that_matters(_as_read_today(run.get("config")))
    pairs = [(*_of_common_variants(earlier_config, _that_matters(settings)), _MEANS)]
    if environment is not None and run.get("environment") is not None:
        pairs.append((run["environment"], environment, frozenset()))
    for earlier, now, without in pairs:
        before = dict(_leaves(earlier, "", without))
        after = dict(_leaves(now, "", without))
        for key in sorted(before.keys() | after.keys()):
            if before.get(key) != after.get(key):
                was, is_now = (side.get(key, "not there") for side in (before, after))
                found.append(f"{key} is {is_now}, was {was}")
    return found


def _runs(work: Path, present: Collection[str]) -> Iterator[Mapping[str, Any]]:
    """The plans of the runs that were about some of the episodes."""
    wanted = set(present)
    for path in sorted((work / "runs").glob("*/plan.json")):
        plan = read_document(path) or {}
        episodes = plan.get("episodes")
        if not isinstance(episodes, list) or not isinstance(plan.get("config"), dict):
            continue
        ids = {one.get("episode_id") for one in episodes if isinstance(one, dict)}
        if ids & wanted:
            yield plan


def _as_read_today(config: Any) -> Any:
    """Settings of an earlier version in today's words, with what has come since at its default."""
    try:
        return dump_config(check_config(config))
    except ConfigError:
        return config  # no longer allowed, or changed by hand: what it says is compared as it is


def _that_matters(config: Any) -> Any:
    """Settings without a campaign that samples nothing: its quotas alone change no episode."""
    campaign = config.get("campaign") if isinstance(config, Mapping) else None
    if isinstance(campaign, Mapping) and not campaign.get("sample"):
        return {key: value for key, value in config.items() if key != "campaign"}
    return config


def _of_common_variants(one: Any, other: Any) -> tuple[Any, Any]:
    """Settings without the variants that only one of them has: others do not change by those.

    All that one has stay where the first weather of a variant changes every episode's grip.
    """
    before, after = _variants_of(one), _variants_of(other)
    if not (before and after):
        return one, other
    if _have_weathers(before) != _have_weathers(after) and _grip_follows(one, other):
        return one, other
    common = before.keys() & after.keys()
    kept = [{name: side[name] for name in side if name in common} for side in (before, after)]
    return {**one, "variants": kept[0]}, {**other, "variants": kept[1]}


def _variants_of(config: Any) -> Mapping[str, Any]:
    variants = config.get("variants") if isinstance(config, Mapping) else None
    return variants if isinstance(variants, Mapping) else {}


def _have_weathers(variants: Mapping[str, Any]) -> bool:
    return any(isinstance(one, Mapping) and "weather" in one for one in variants.values())


def _grip_follows(*configs: Mapping[str, Any]) -> bool:
    """Whether variants decide if water on the road takes grip, see ``server.wet_grip``."""
    servers = [config.get("server") for config in configs]
    return any(isinstance(one, Mapping) and one.get("wet_grip") == "auto" for one in servers)


def _leaves(value: Any, path: str, without: Collection[str]) -> Iterator[tuple[str, str]]:
    """Path and JSON text of each value of a document, empty containers among them."""
    if path in without:
        return
    if isinstance(value, Mapping) and value:
        for key, below in value.items():
            yield from _leaves(below, f"{path}.{key}" if path else str(key), without)
    elif isinstance(value, list | tuple) and value:
        for position, below in enumerate(value):
            yield from _leaves(below, f"{path}[{position}]", without)
    else:
        yield path, json.dumps(value)
