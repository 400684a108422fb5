"""On which graphics card a server runs, by what nvidia-smi says."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from carstage.errors import ServerError
from carstage.server.graphics import describe_card, graphics_cards, wanted_card

CARD = """<gpu id="0000:0{index}:00.0"><product_name>NVIDIA Card {index}</product_name>
<minor_number>{index}</minor_number><processes>{processes}</processes></gpu>"""
PROCESS = """<process_info><gpu_instance_id>N/A</gpu_instance_id><pid>{pid}</pid><type>G</type>
<process_name>CarlaUE4-Linux-Shipping</process_name><used_memory>900 MiB</used_memory>
</process_info>"""


@pytest.fixture
def smi(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A program ``nvidia-smi`` that prints what the file beside it holds."""
    program = tmp_path / "nvidia-smi"
    program.write_text('#!/bin/sh\ncat "$0.xml"\n')
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    return tmp_path / "nvidia-smi.xml"


def say(smi: Path, *pids: int | None) -> None:
    cards = [
        CARD.format(index=index, processes="" if pid is None else PROCESS.format(pid=pid))
        for index, pid in enumerate(pids)
    ]
    smi.write_text(f'<?xml version="1.0" ?>\n<nvidia_smi_log>{"".join(cards)}</nvidia_smi_log>')


def test_cards_and_their_processes_are_read(smi: Path) -> None:
    say(smi, None, 4711)
    first, second = graphics_cards()
    assert (first.index, first.name, first.pids) == (0, "NVIDIA Card 0", frozenset())
    assert (second.index, second.pids) == (1, frozenset({4711}))


@pytest.mark.parametrize("text", ["", "no XML", "<nvidia_smi_log></nvidia_smi_log>"])
def test_an_nvidia_smi_that_fails_shows_no_card(smi: Path, text: str) -> None:
    smi.write_text(text)
    assert graphics_cards() == ()


def test_without_nvidia_smi_the_card_cannot_be_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    found, sentence = describe_card(1, os.getpgid(0))
    assert found is None
    assert sentence == (
        "Whether the server runs on graphics card 1 cannot be seen: there is no nvidia-smi."
    )


def test_a_server_on_its_card_needs_no_word(smi: Path) -> None:
    say(smi, None, os.getpid())
    assert describe_card(1, os.getpgid(0)) == (1, "")


def test_a_server_on_another_card_is_told(smi: Path) -> None:
    say(smi, os.getpid(), None)
    found, sentence = describe_card(1, os.getpgid(0))
    assert found == 0
    assert sentence == "The server was to use graphics card 1, and runs on 0."


def test_in_a_container_the_card_cannot_be_seen(smi: Path) -> None:
    say(smi, None, None)
    found, sentence = describe_card(0, os.getpgid(0))
    assert found is None
    assert "nvidia-smi does not show its process" in sentence


def test_the_wanted_card_stands_among_the_arguments() -> None:
    assert wanted_card(["-RenderOffScreen"]) is None
    assert wanted_card(["-RenderOffScreen", "-graphicsadapter=3"]) == 3
    with pytest.raises(ServerError, match="names no graphics card"):
        wanted_card(["-graphicsadapter=first"])
