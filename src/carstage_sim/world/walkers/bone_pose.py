"""The pose that a client gave a walker's bones."""

from __future__ import annotations

from dataclasses import dataclass, field

from carstage_sim.world.pose import Pose


@dataclass(slots=True)
class BonePose:
    """Poses of bones in their parents' frames, and how much of them is shown.

    Attributes:
        relative: by the bones' names; bones that are missing keep their animation.
        blend: 0 shows the animation, 1 the pose.
    """

    relative: dict[str, Pose] = field(default_factory=dict)
    blend: float = 0.0
