"""NVIDIA's graphics cards: which are here, and on which of them a server runs."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Collection
from dataclasses import dataclass

import psutil

from carstage.errors import ServerError

_COMMAND = ("nvidia-smi", "-q", "-x")
_TIMEOUT_S = 20.0
ADAPTER_OPTION = "-graphicsadapter="
"""Option of CARLA's server."""


@dataclass(frozen=True, slots=True)
class GraphicsCard:
    """A card as ``nvidia-smi`` lists it.

    Attributes:
        index: its place in the list, from 0.
        name: what it is called.
        pids: processes that use it; none where the process ids are those of another container.
    """

    index: int
    name: str
    pids: frozenset[int]


def graphics_cards() -> tuple[GraphicsCard, ...]:
    """The cards of this machine; none where ``nvidia-smi`` is missing, fails or takes too long."""
    try:
        listed = subprocess.run(
            _COMMAND, stdin=subprocess.DEVNULL, capture_output=True, timeout=_TIMEOUT_S, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return ()
    from xml.etree import ElementTree

    try:
        root = ElementTree.fromstring(listed.stdout)
    except ElementTree.ParseError:
        return ()
    return tuple(
        GraphicsCard(
            index,
            card.findtext("product_name", "").strip(),
            frozenset(
                int(text)
                for process in card.iter("process_info")
                if (text := process.findtext("pid", "").strip()).isdigit()
            ),
        )
        for index, card in enumerate(root.iter("gpu"))
    )


def wanted_card(arguments: Collection[str]) -> int | None:
    """The card that a server's arguments ask for; None: they leave it to the server.

    Raises:
        ServerError: that is no number.
    """
    for argument in arguments:
        if argument.lower().startswith(ADAPTER_OPTION):
            number = argument[len(ADAPTER_OPTION) :]
            if not number.isdigit():
                raise ServerError(f"server.arguments: {argument} names no graphics card.")
            return int(number)
    return None


def describe_card(wanted: int, group: int) -> tuple[int | None, str]:
    """On which card a server runs that was to use a certain one.

    CARLA counts cards as Vulkan does, ``nvidia-smi`` by their place on the bus: where the two
    differ, servers may have changed places, and each still has a card of its own.

    Args:
        wanted: the card that it was to use.
        group: id of the server's process group.

    Returns:
        Its card, None where that cannot be seen; and a sentence for the user, empty where it is the
        wanted one.
    """
    pids = {one.pid for one in psutil.process_iter() if _group(one.pid) == group}
    cards = graphics_cards()
    found = [card.index for card in cards if card.pids & pids]
    if not found:
        why = "nvidia-smi does not show its process" if cards else "there is no nvidia-smi"
        return None, f"Whether the server runs on graphics card {wanted} cannot be seen: {why}."
    if found == [wanted]:
        return wanted, ""
    named = ", ".join(map(str, found))
    return found[0], f"The server was to use graphics card {wanted}, and runs on {named}."


def _group(pid: int) -> int | None:
    try:
        return os.getpgid(pid)
    except (ProcessLookupError, PermissionError):
        return None
