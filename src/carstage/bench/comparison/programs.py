"""The programs that are compared: what each is, how it is started, where its files are."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from carstage.execution.collector_process import interpreter_command

_CLIENTS = "carstage.bench.clients"
CARSTAGE, FPNG, DISCARD = "carstage", "carstage-fpng", "discard"
NATIVE, NUMPY = "native-png", "native-npy"
_LOOK_FOR = """
import importlib.util, sys
print(*[name for name in sys.argv[1:] if importlib.util.find_spec(name) is None])
"""


@dataclass(frozen=True, slots=True)
class Program:
    """A way to record.

    Attributes:
        name: in tables.
        what: one line on it.
        module: of ``carstage.bench.clients``; None is Car-STAGE's own command.
        options: of that module.
        codec: for colour pictures, of Car-STAGE.
        slow: every picture takes long; see ``Preset.slow_share``.
        seconds: rough seconds per picture and per point cloud on two cores, for the estimate.
        lossless: its pictures can be compared with the others'.
        timing: how the world is stepped, where not in the synchronous mode.
        needs: packages that the client's Python must have, besides ``carla``.
    """

    name: str
    what: str
    module: str | None
    options: tuple[str, ...] = ()
    codec: str | None = None
    slow: bool = False
    seconds: float = 0.02
    lossless: bool = True
    timing: Mapping[str, Any] = field(default_factory=dict)
    needs: tuple[str, ...] = ()

    @property
    def keeps(self) -> bool:
        """Whether it leaves anything on the disk."""
        return self.name != DISCARD

    def lacks(self, python: str, labels: bool) -> list[str]:
        """Packages that it needs and an interpreter has not; Car-STAGE runs with its own."""
        needs = (*self.needs, "numpy") if labels and self.module is not None else self.needs
        ended = subprocess.run(
            [python, "-c", _LOOK_FOR, *needs], capture_output=True, text=True, check=True
        )
        return ended.stdout.split()

    def command(self, plan: Path, python: str, labels: bool) -> list[str]:
        """The command of a client.

        Args:
            plan: the collector's plan.
            python: interpreter with the client's wheel.
            labels: every frame shall be labelled.
        """
        boxes = ["--boxes"] if labels and self.module == "native" else []
        command = interpreter_command(python, f"{_CLIENTS}.{self.module}")
        return [*command, str(plan), *self.options, *boxes]

    def own_command(self, config: Mapping[str, Any], folder: Path) -> list[str]:
        """The command of Car-STAGE: ``carstage run`` on a configuration that is written here."""
        path = folder / "config.yaml"
        path.write_text(json.dumps(config), "utf-8")  # JSON is YAML
        return [
            *(sys.executable, "-m", "carstage.cli", "run", str(path)),
            *("--out", str(folder / "dataset"), "--retries", "0"),
        ]


PROGRAMS: Final[dict[str, Program]] = {
    program.name: program
    for program in (
        Program(DISCARD, "ticks, listens and drops: the limit", "discard", seconds=0.004),
        Program(CARSTAGE, "Car-STAGE as it ships", None),
        Program(FPNG, "Car-STAGE with the codec fpng", None, codec="fpng"),
        Program(
            NATIVE,
            "save_to_disk as PNG in one thread, CARLA's example of the synchronous mode",
            "native",
            slow=True,
            seconds=1.2,
        ),
        Program(
            "native-tiff",
            "the same, as TIFF",
            "native",
            ("--format", "tiff"),
            seconds=0.04,
        ),
        Program(
            "native-jpg",
            "the same, as JPEG",
            "native",
            ("--format", "jpg"),
            seconds=0.08,
            lossless=False,
        ),
        Program(
            "native-threads",
            "save_to_disk as PNG in a thread for each core",
            "native_threads",
            slow=True,
            seconds=0.8,
        ),
        Program(
            "native-async",
            "save_to_disk as PNG in callbacks, the server running freely",
            "native_async",
            slow=True,
            seconds=1.0,
            lossless=False,
            timing={"mode": "async"},
        ),
        Program(
            "pillow",
            "NumPy and Pillow with its defaults",
            "pillow",
            slow=True,
            seconds=0.8,
            needs=("numpy", "PIL"),
        ),
        Program(
            "paper",
            "the paper's design: thread pool, memory-mapped seconds, then a process pool, OpenCV",
            "paper",
            seconds=0.1,
            needs=("numpy", "cv2"),
        ),
        Program(
            "paper-own-png",
            "the same with Car-STAGE's PNG encoder",
            "paper",
            ("--encoder", "carstage"),
            seconds=0.05,
            needs=("numpy", "deflate", "numba", "PIL"),
        ),
        Program(
            "native-ply",
            "save_to_disk of point clouds: PLY as text",
            "native",
            slow=True,
            seconds=0.4,
            lossless=False,
        ),
        Program(
            NUMPY,
            "numpy.save of point clouds in the callback",
            "native_npy",
            needs=("numpy",),
        ),
    )
}
