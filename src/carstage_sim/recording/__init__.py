"""CARLA's recorder and replayer: logs in CARLA's own binary format, and the texts about them.

A log holds what happened, not what was seen: actors that come and go, poses, controls, lights. The
layout is that of CARLA's documentation page "Recorder binary file format".
"""

from carstage_sim.recording.errors import RecordingError
from carstage_sim.recording.folder import RecordingsFolder
from carstage_sim.recording.recorder_controller import RecorderController

__all__ = ["RecorderController", "RecordingError", "RecordingsFolder"]
