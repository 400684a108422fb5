"""MCAP: a file per episode that Foxglove, Lichtblick, Rerun and ROS 2 open."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from carstage import __version__
from carstage.dataset import Episode
from carstage.dataset.saved_frames import Frame
from carstage.errors import BadInputError
from carstage.exporters.classes import CLASSES
from carstage.exporters.exporter import Exporter, register
from carstage.exporters.formats.foxglove_layout import layout
from carstage.exporters.formats.mcap_messages import Stamped, nanoseconds
from carstage.exporters.options import ExportOptions
from carstage.exporters.variants import variant_entry

if TYPE_CHECKING:
    from mcap.writer import Writer

_MODULES = {
    "foxglove": ("mcap", "foxglove_schemas_protobuf"),
    "ros2": ("mcap", "rosbags"),
}
_EXTRAS = {"foxglove": "mcap", "ros2": "ros2"}


@dataclass(frozen=True, slots=True)
class FramePart:
    """What a frame adds to its file.

    Attributes:
        time_ns: time since the first frame.
        messages: in the order of the file.
    """

    time_ns: int
    messages: tuple[Stamped, ...]


@dataclass(frozen=True, slots=True)
class MessageWriter:
    """Makes the messages of a frame."""

    options: ExportOptions

    def __call__(self, frame: Frame, folder: Path) -> FramePart:
        """All messages of the frame."""
        from carstage.exporters.formats.mcap_contents import frame_records

        del folder
        made = _message_module(self.options)
        stamped = tuple(
            message
            for record in frame_records(frame, self.options)
            for message in made.messages(record, frame.timestamp_s)
        )
        return FramePart(nanoseconds(frame.timestamp_s), stamped)


@register
class McapFiles(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "mcap"
    summary: ClassVar = (
        "MCAP with Foxglove or ROS 2 messages, a file per episode (extras `mcap`, `ros2`)."
    )
    uses: ClassVar = frozenset(
        {
            "boxes",
            "classes",
            "class_map",
            "include_invisible",
            "max_distance_m",
            "messages",
            "min_lidar_points",
        }
    )

    def __init__(self, options: ExportOptions) -> None:
        everything = () if options.class_map else tuple(CLASSES)
        classes = options.classes or everything
        messages = options.messages or "foxglove"
        super().__init__(replace(options, classes=classes, messages=messages))

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Ask for the packages; every rig will do whose sensors have topics of their own.

        Raises:
            BadInputError: the extra is not installed, or two sensors would share their topics.
        """
        if any(find_spec(name) is None for name in _MODULES[_messages(self.options)]):
            raise BadInputError(
                "The format mcap needs packages that are not installed.",
                f"Install them: pip install 'carstage[{_EXTRAS[_messages(self.options)]}]'.",
            )
        self._folder = folder
        self._topics: dict[str, str] = {}
        self._module = _message_module(self.options)
        if _messages(self.options) == "ros2":
            for episode in episodes:
                _check_topics(episode, self._module.topic_name)

    def begin_episode(self, episode: Episode) -> MessageWriter:
        """Open the episode's file."""
        from mcap.writer import Writer

        file = (self._folder / f"{episode.id}.mcap").open("wb")
        self._writer: Writer = Writer(self.files.enter_context(file))
        self._writer.start(profile=self._module.PROFILE, library=f"carstage {__version__}")
        self._writer.add_metadata(
            "episode",
            {
                "episode_id": episode.id,
                **variant_entry(episode),
                "map": str(episode.document["map"]),
            },
        )
        self._schemas: dict[str, tuple[int, str]] = {}
        self._channels: dict[str, int] = {}
        self._counts: Counter[str] = Counter()
        return MessageWriter(self.options)

    def add(self, part: FramePart) -> None:
        """Append the frame's messages."""
        for message in part.messages:
            channel = self._channel(message)
            self._writer.add_message(
                channel,
                log_time=part.time_ns,
                publish_time=part.time_ns,
                data=message.data,
                sequence=self._counts[message.topic],
            )
            self._counts[message.topic] += 1

    def end_episode(self) -> None:
        """Write the file's index."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self.close()

    def finish(self) -> None:
        """Write a layout for the topics of all files."""
        document = json.dumps(layout(self._topics), indent=1)
        (self._folder / "layout.json").write_text(document + "\n")

    def _channel(self, message: Stamped) -> int:
        if message.topic not in self._channels:
            self._topics[message.topic] = message.schema
            schema, coding = self._schema(message.schema)
            self._channels[message.topic] = self._writer.register_channel(
                message.topic, coding, schema
            )
        return self._channels[message.topic]

    def _schema(self, name: str) -> tuple[int, str]:
        """Number of the schema in the file, and how its messages are coded."""
        if name not in self._schemas:
            coding, encoding, content = self._module.schema(name)
            self._schemas[name] = self._writer.register_schema(name, encoding, content), coding
        return self._schemas[name]


def _check_topics(episode: Episode, topic_name: Callable[[str], str]) -> None:
    seen: dict[str, str] = {}
    for sensor in episode.sensors:
        other = seen.setdefault(topic_name(f"/{sensor.id}"), sensor.id)
        if other != sensor.id:
            raise BadInputError(
                f"Episode {episode.id}: {other!r} and {sensor.id!r} would have the same topics, "
                "as ROS 2 has neither '.' nor '-' in names.",
                "Use --messages foxglove, or other ids when you record.",
            )


def _messages(options: ExportOptions) -> str:
    return options.messages or "foxglove"


def _message_module(options: ExportOptions) -> Any:
    """The module that makes messages: ``PROFILE``, ``messages`` and ``schema``."""
    return import_module(f"carstage.exporters.formats.{_messages(options)}_messages")
