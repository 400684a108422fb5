"""Configuration files that somebody made to do harm, or that are none: refused soon, in words."""

from __future__ import annotations

import os
import random
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from importlib import resources
from pathlib import Path

import pytest

from carstage.config import check_config, dump_config, load_config, parse_config
from carstage.errors import ConfigError

_SOON_CPU_S = 10.0
"""Far more than it takes: what has no end, or grows with a power of its size, takes longer."""


def bomb(lines: int) -> str:
    """Each line holds the one before it ten times."""
    text = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n"
    return text + "".join(
        f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, lines)
    )


REFUSED = {
    "alias bomb": bomb(12),
    "merge bomb": "a0: &a0 {x: 1}\n"
    + "".join(f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 10)}]}}\n" for i in range(1, 12)),
    "list that holds itself": "a: &a [*a]",
    "mapping that holds itself": "a: &a {b: *a}",
    "mapping that merges itself": "a: &a {<<: *a}",
    "brackets": "[" * 100_000,
    "closed brackets": "a: " + "[" * 3000 + "]" * 3000,
    "braces": "{a: " * 20_000,
    "deep blocks": "".join(" " * depth + "a:\n" for depth in range(1500)),
    "long list": "a: [" + "1," * 900_000 + "]",
    "many lines": "a:\n" + "- 1\n" * 400_000,
    "many keys": "".join(f"k{number}: 1\n" for number in range(150_000)),
    "many anchors": "".join(f"k{number}: &a{number} 1\n" for number in range(100_000)),
    "long number": "seed: " + "9" * 1_000_000,
    "long hexadecimal number": "seed: 0x" + "f" * 1_000_000,
    "huge exponent": "fps: 1e999999999",
    "object": '!!python/object/apply:os.system ["true"]',
    "object inside": 'name: !!python/name:os.system ""',
    "unknown tag": "name: !thing x",
    "binary": "name: !!binary aGVsbG8=",
    "two documents": "fps: 10\n---\nfps: 20\n",
    "key twice": "fps: 10\nfps: 20\n",
    "key that is none": "? [a, b]\n: 1\n",
    "number as key": "1: 2\n",
    "null byte": "name: \0",
    "escape": "name: \x1b[2J",
    "unpaired surrogate": 'name: "\\ud800"',
    "tabs": "rig:\n\tpreset: demo\n",
    "list": "- 1\n",
    "word": "hello",
    "number": "7",
    "not closed": 'name: "abc',
    "unknown alias": "name: *nobody",
    "percent": "%YAML 9.9\n---\nname: x\n",
    "long line of text": "x" * 1_500_000,
}


@pytest.mark.parametrize("text", REFUSED.values(), ids=REFUSED.keys())
def test_hostile_texts_are_refused_soon(text: str, tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(text, "utf-8")
    began_s = time.process_time()
    with pytest.raises(ConfigError) as refused:
        load_config(path)
    assert time.process_time() - began_s < _SOON_CPU_S
    assert len(str(refused.value)) < 2000


@pytest.mark.parametrize("text", REFUSED.values(), ids=REFUSED.keys())
def test_hostile_overrides_are_refused_soon(text: str) -> None:
    began_s = time.process_time()
    with pytest.raises(ConfigError):
        parse_config("", [f"rig={text}"])
    assert time.process_time() - began_s < _SOON_CPU_S


def _fifo(path: Path) -> None:
    os.mkfifo(path)


def _socket(path: Path) -> None:
    listening = socket.socket(socket.AF_UNIX)
    listening.bind(str(path))
    listening.close()


def _comments(path: Path) -> None:
    path.write_bytes(b"# nothing\n" * 3_000_000)


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(1 << 40)


FILES: dict[str, Callable[[Path], object]] = {
    "fifo": _fifo,
    "socket": _socket,
    "30 MB of comments": _comments,
    "a terabyte of nothing": _sparse,
    "folder": lambda path: path.mkdir(),
    "zero": lambda path: path.symlink_to("/dev/zero"),
    "random": lambda path: path.symlink_to("/dev/urandom"),
    "terminal": lambda path: path.symlink_to("/dev/tty"),
    "link to itself": lambda path: path.symlink_to(path),
    "missing": lambda path: None,
    "Latin-1": lambda path: path.write_bytes(b"name: Stra\xdfe"),
    "UTF-16": lambda path: path.write_bytes("fps: 10".encode("utf-16")),
    "picture": lambda path: path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256))),
}


@pytest.mark.parametrize("make", FILES.values(), ids=FILES.keys())
def test_what_is_no_text_file_is_refused_without_reading_it(
    make: Callable[[Path], object], tmp_path: Path
) -> None:
    path = tmp_path / "config.yaml"
    make(path)
    began_s = time.process_time()
    with pytest.raises(ConfigError, match=r"cannot be read|not YAML|unacceptable"):
        load_config(path)
    assert time.process_time() - began_s < _SOON_CPU_S


@pytest.mark.parametrize("seed", range(100))
def test_a_text_with_random_damage_is_read_or_refused(seed: int) -> None:
    rng = random.Random(seed)
    text = list(resources.files("carstage.config").joinpath("demo.yaml").read_text("utf-8"))
    for _ in range(rng.randint(1, 20)):
        at = rng.randrange(len(text))
        choice = rng.random()
        if choice < 0.4:
            text[at] = rng.choice("{}[]:,#&*!|>'\"%@`\n\t -?~0a\u2028\ufeff")
        elif choice < 0.7:
            del text[at : at + rng.randint(1, 30)]
        else:
            text[at:at] = text[rng.randrange(len(text)) :][: rng.randint(1, 60)]
    with suppress(ConfigError):
        config = parse_config("".join(text))
        assert check_config(dump_config(config)) == config
