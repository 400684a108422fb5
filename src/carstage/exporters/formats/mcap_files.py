"""MCAP with Foxglove's schemas: a file per episode that Foxglove and Rerun open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from carstage import __version__
from carstage.dataset import Episode
from carstage.dataset.saved_frames import Frame
from carstage.errors import BadInputError
from carstage.exporters.classes import CLASSES
from carstage.exporters.exporter import Exporter, register
from carstage.exporters.options import ExportOptions

if TYPE_CHECKING:
    from mcap.writer import Writer

    from carstage.exporters.formats.foxglove_messages import Stamped


@dataclass(frozen=True, slots=True)
class MessageWriter:
    """Makes the messages of a frame."""

    options: ExportOptions

    def __call__(self, frame: Frame, folder: Path) -> tuple[int, tuple[Stamped, ...]]:
        """Time in nanoseconds, and the messages."""
        from carstage.exporters.formats.foxglove_messages import frame_messages, nanoseconds

        del folder
        return nanoseconds(frame.timestamp_s), tuple(frame_messages(frame, self.options))


@register
class McapFiles(Exporter):
    """See docs/formats/exports.md."""

    name: ClassVar = "mcap"
    summary: ClassVar = "MCAP with Foxglove schemas, a file per episode (extra `mcap`)."
    uses: ClassVar = frozenset(
        {"boxes", "classes", "min_lidar_points", "max_distance_m", "include_invisible"}
    )

    def __init__(self, options: ExportOptions) -> None:
        super().__init__(replace(options, classes=options.classes or tuple(CLASSES)))

    def begin(self, episodes: Sequence[Episode], folder: Path) -> None:
        """Ask for the packages; every rig will do.

        Raises:
            BadInputError: the extra is not installed.
        """
        if find_spec("mcap") is None or find_spec("foxglove_schemas_protobuf") is None:
            raise BadInputError(
                "The format mcap needs packages that are not installed.",
                "Install them: pip install 'carstage[mcap]'.",
            )
        self._folder = folder

    def begin_episode(self, episode: Episode) -> MessageWriter:
        """Open the episode's file."""
        from mcap.writer import Writer

        file = (self._folder / f"{episode.id}.mcap").open("wb")
        self._writer: Writer = Writer(self.files.enter_context(file))
        self._writer.start(profile="", library=f"carstage {__version__}")
        self._writer.add_metadata(
            "episode", {"episode_id": episode.id, "map": str(episode.document["map"])}
        )
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        return MessageWriter(self.options)

    def add(self, part: tuple[int, tuple[Stamped, ...]]) -> None:
        """Append the frame's messages."""
        time_ns, messages = part
        for message in messages:
            self._writer.add_message(
                self._channel(message),
                log_time=time_ns,
                publish_time=time_ns,
                data=message.data,
            )

    def end_episode(self) -> None:
        """Write the file's index."""
        self._writer.finish()  # type: ignore[no-untyped-call]
        self.close()

    def finish(self) -> None:
        """Every file is whole already."""

    def _channel(self, message: Stamped) -> int:
        if message.topic not in self._channels:
            if message.schema not in self._schemas:
                self._schemas[message.schema] = self._writer.register_schema(
                    message.schema, "protobuf", _descriptors(message.schema)
                )
            self._channels[message.topic] = self._writer.register_channel(
                message.topic, "protobuf", self._schemas[message.schema]
            )
        return self._channels[message.topic]


def _descriptors(schema: str) -> bytes:
    """The type and all that it is made of, each before what uses it."""
    from google.protobuf.descriptor_pb2 import FileDescriptorSet

    from carstage.exporters.formats.foxglove_messages import MESSAGES

    found: dict[str, Any] = {}

    def collect(file: Any) -> None:
        for dependency in file.dependencies:
            collect(dependency)
        found.setdefault(file.name, file)

    collect(MESSAGES[schema].DESCRIPTOR.file)
    descriptors = FileDescriptorSet()
    for file in found.values():
        file.CopyToProto(descriptors.file.add())
    return descriptors.SerializeToString()
