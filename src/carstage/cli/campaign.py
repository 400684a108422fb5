"""``carstage campaign``: how far a campaign is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from carstage.cli.configuration import read_configuration
from carstage.cli.output import Debug, Json, command, dataset_address, result, result_json

if TYPE_CHECKING:
    from carstage.dataset.campaigns import CampaignState

campaign_app = typer.Typer(help="Campaigns: settings that are sampled.", no_args_is_help=True)


@campaign_app.command("report")
@command
def campaign_report(
    dataset: Annotated[
        Path,
        typer.Argument(metavar="DATASET", help="Folder of the dataset.", callback=dataset_address),
    ],
    config: Annotated[
        Path,
        typer.Argument(metavar="CONFIG", help="The configuration, YAML; `-`: standard input."),
    ],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override one value. Repeatable."),
    ] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Say what of a campaign is recorded: episodes by sampled value, and quotas."""
    del debug
    from carstage.dataset import Dataset
    from carstage.dataset.campaigns import campaign_state

    state = campaign_state(read_configuration(config, settings or ()), Dataset(dataset))
    if json:
        result_json(state.to_json())
    else:
        result("\n".join(_lines(state)))


def _lines(state: CampaignState) -> list[str]:
    """The state for people."""
    lines = [f"{state.name}: {state.committed} of {state.planned} episodes are committed."]
    if state.others:
        lines.append(f"The dataset holds {state.others} more, of other configurations.")
    if state.combinations:
        what = f"{state.covered} of {state.combinations} combinations"
        lines.append(f"{state.method}: {what} have an episode.")
    for name, bins in state.dimensions.items():
        lines.append(f"{name}:")
        width = max(len(one.label) for one in bins)
        lines += [f"  {one.label:<{width}}  {one.episodes} of {one.planned}" for one in bins]
    for quota in state.quotas:
        met = "met" if quota.met else "not met"
        lines.append(f"quota {quota.name}: {quota.frames} of {quota.wanted} frames, {met}")
    return lines
