"""``carstage estimate``: what a configuration will take, before it is recorded."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from carstage.cli.output import Debug, Json, command, note, result, result_json

if TYPE_CHECKING:
    from carstage.runs.estimating import CampaignEstimate

_HIGHEST_PRICE = 1e9
"""What is not finite has no place in JSON."""


@command
def estimate(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="The configuration, YAML.")],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override one value. Repeatable."),
    ] = None,
    pilot: Annotated[
        int, typer.Option("--pilot", min=0, max=100, help="Short episodes to record; 0: none.")
    ] = 3,
    no_pilot: Annotated[
        bool, typer.Option("--no-pilot", help="Record nothing; reckon by known figures.")
    ] = False,
    pilot_seconds: Annotated[
        float, typer.Option(min=1.0, max=3600.0, help="Simulated seconds of each, at most.")
    ] = 3.0,
    workers: Annotated[
        int, typer.Option("--workers", min=1, max=100_000, help="Servers at the same time.")
    ] = 1,
    price_core_hour: Annotated[
        float, typer.Option(min=0.0, max=_HIGHEST_PRICE, help="Price of a core for an hour.")
    ] = 0.0,
    price_gpu_hour: Annotated[
        float,
        typer.Option(min=0.0, max=_HIGHEST_PRICE, help="Price of a worker's GPU for an hour."),
    ] = 0.0,
    price_gb_month: Annotated[
        float,
        typer.Option(
            min=0.0, max=_HIGHEST_PRICE, help="Price of a gigabyte of storage for a month."
        ),
    ] = 0.0,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Estimate hours, core-hours, gigabytes and money, from a few short episodes."""
    del debug
    from carstage.config import load_config
    from carstage.runs.estimating import Prices, estimate_by_pilots, estimate_by_table
    from carstage.runs.pilot import record_pilots
    from carstage.runs.preflight import judge

    loaded = load_config(config, settings or ())
    plan = judge(loaded)
    prices = Prices(price_core_hour, price_gpu_hour, price_gb_month)
    if no_pilot or not pilot:
        found = estimate_by_table(loaded, plan, workers=workers, prices=prices)
    else:
        pilots = record_pilots(loaded, pilot, note, longest_s=pilot_seconds)
        found = estimate_by_pilots(loaded, plan, pilots, workers=workers, prices=prices)
    if json:
        result_json(found.to_json())
    else:
        result("\n".join(_lines(found)))


def _lines(found: CampaignEstimate) -> list[str]:
    """The estimate for people."""
    from carstage.runs.preflight import size_text

    def sure(name: str) -> str:
        return f" ± {found.error[name]:.0%}" if name in found.error else ""

    servers = "worker" if found.workers == 1 else "workers"
    lines = [
        f"{found.episodes} episodes, {found.frames} frames",
        f"time        {_hours(found.hours)}{sure('hours')}, with {found.workers} {servers}",
        f"core-hours  {found.core_hours:.3g}{sure('core_hours')}",
        f"dataset     {size_text(found.dataset_bytes)}{sure('dataset_bytes')}",
        f"on the way  {size_text(found.peak_bytes)} at most",
    ]
    for name, amount in found.money.items():
        lines.append(f"money       {amount:.2f} ({name.replace('_month', ', one month')})")
    return [*lines, *found.notes]


def _hours(hours: float) -> str:
    return f"{hours:.3g} hours" if hours >= 1.0 else f"{hours * 60.0:.3g} minutes"
