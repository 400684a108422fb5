"""Plays a log back into a world, tick by tick.

As in CARLA, replayed vehicles and walkers lose their physics and their collisions, and get both
back at the end, where vehicles are left standing with free pedals for whoever drives them next.
Otherwise than in CARLA, whose replay is one recorded frame late, the frame at a recorded time shows
the poses of that time.
"""

from __future__ import annotations

import bisect
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.recording.events import CM_PER_M, bones, pose_of_ue, wheels
from carstage_sim.recording.layout import Packet, records
from carstage_sim.recording.log import RecordingLog
from carstage_sim.recording.replay_actors import ReplayCast, ReplayOptions
from carstage_sim.world.columns import Rotation
from carstage_sim.world.controls import VehicleControl, WalkerControl
from carstage_sim.world.pose import Pose, compose
from carstage_sim.world.state import ActorKind
from carstage_sim.world.walkers.bones import pose_bones
from carstage_sim.world.world import World


class Replayer:
    """One replay in one episode; it owns the log.

    Args:
        log: what to play; closed by :meth:`stop`.
        world: where.
        options: from when to when, and what to leave out.
        time_factor: recorded seconds per simulated second.
    """

    def __init__(
        self, log: RecordingLog, world: World, options: ReplayOptions, time_factor: float = 1.0
    ) -> None:
        self._log = log
        self._world = world
        self._options = options
        self._elapsed_s = [frame.elapsed_s for frame in log.frames]
        self._time_s, self._end_s = options.span_s(log.duration_s)
        self._cast = ReplayCast(world, options)
        self._next = 0
        self._poses: tuple[int, Mapping[int, NDArray[np.float32]]] = (-1, {})
        self.running = bool(log.frames)
        world.lights.led = self.running
        try:
            frame = self._frame_at(self._time_s)
            newcomers = self._play_events_until(frame)
            if self.running:
                self._place(frame, newcomers, time_factor)
        except BaseException:
            self.stop(keep_actors=False)  # which lets lights and actors go
            raise

    def advance(self, delta_s: float) -> None:
        """Bring the world to the recorded moment ``delta_s`` later, before it ticks."""
        if not self.running:
            return
        self._time_s += delta_s
        frame = self._frame_at(self._time_s)
        newcomers = self._play_events_until(frame)
        self._show(frame)
        self._place(frame, newcomers)
        self._follow()

    def finish_if_over(self) -> None:
        """End the replay after the tick that showed its last moment."""
        if self.running and self._time_s >= self._end_s - 1e-6:
            self.stop(keep_actors=True)

    def stop(self, *, keep_actors: bool) -> None:
        """End the replay where it is; may be called twice.

        Args:
            keep_actors: leave the actors that the replay brought; otherwise they are destroyed.
        """
        self._log.close()
        if not self.running:
            return
        self.running = False
        self._world.lights.led = False
        self._world.lights.adopt_states()
        self._cast.dismiss(keep_actors=keep_actors)

    def _frame_at(self, time_s: float) -> int:
        """Index of the last frame that is not after a time; -1 for an empty log."""
        return bisect.bisect_right(self._elapsed_s, time_s + 1e-9) - 1

    def _play_events_until(self, last: int) -> set[int]:
        """Let actors come and go up to and with a frame; no frame is played twice.

        Returns:
            Recorded ids of those that came.
        """
        newcomers: set[int] = set()
        while self._next <= last:
            newcomers |= self._cast.play(list(self._log.packets(self._next)))
            self._next += 1
        return newcomers

    # What a frame shows --------------------------------------------------------------------------

    def _show(self, frame: int) -> None:
        """Everything of a frame but poses."""
        for kind, payload in self._log.packets(frame):
            if kind == Packet.STATE:
                self._show_lights(records(Packet.STATE, payload))
            elif kind == Packet.ANIM_VEHICLE:
                for row in records(Packet.ANIM_VEHICLE, payload):
                    self._control(row)
            elif kind == Packet.ANIM_VEHICLE_WHEELS:
                for recorded_id, seen in wheels(payload):
                    actor = self._cast.actor(recorded_id)
                    if actor is not None and actor.vehicle is not None and seen:
                        angle_deg = max((wheel.steer_deg for wheel in seen), key=abs)
                        self._world.fleet.set_wheel_angle(actor.actor_id, angle_deg)
            elif kind == Packet.VEHICLE_LIGHT:
                for row in records(Packet.VEHICLE_LIGHT, payload):
                    actor = self._cast.actor(int(row["id"]))
                    if actor is not None and actor.vehicle is not None:
                        actor.vehicle.light_state = int(row["state"])
            elif kind == Packet.ANIM_WALKER:
                for row in records(Packet.ANIM_WALKER, payload):
                    self._walk(row)
            elif kind == Packet.WALKER_BONES:
                for recorded_id, posed in bones(payload):
                    actor = self._cast.actor(recorded_id)
                    if actor is not None and actor.kind is ActorKind.WALKER:
                        pose_bones(actor, posed, blend=1.0)

    def _show_lights(self, rows: NDArray[np.void]) -> None:
        lights = self._world.lights
        for row in rows:
            actor = self._cast.actor(int(row["id"]))
            if actor is not None and actor.kind is ActorKind.TRAFFIC_LIGHT:
                index = self._world.light_index(actor.actor_id)
                lights.show(index, int(row["state"]), float(row["elapsed"]))
                lights.frozen[index] = bool(row["frozen"])

    def _control(self, row: Any) -> None:
        actor = self._cast.actor(int(row["id"]))
        if actor is None:
            return
        gear = int(row["gear"])
        control = VehicleControl(
            float(row["throttle"]),
            float(row["steer"]),
            float(row["brake"]),
            bool(row["hand_brake"]),
            reverse=gear < 0,
            gear=gear,
        )
        self._world.control_vehicle(actor.actor_id, control)

    def _walk(self, row: Any) -> None:
        actor = self._cast.actor(int(row["id"]))
        if actor is None:
            return
        yaw_rad = np.radians(self._world.actors.pose(actor.actor_id).rotation_deg[Rotation.YAW])
        direction = (float(np.cos(yaw_rad)), float(np.sin(yaw_rad)), 0.0)
        control = WalkerControl(direction, float(row["speed"]))
        self._world.control_walker(actor.actor_id, control)

    def _place(self, frame: int, newcomers: Collection[int], time_factor: float = 0.0) -> None:
        """Poses between this frame and the next one.

        Args:
            frame: the last one that is over.
            newcomers: recorded ids of those whose way to their pose is not motion.
            time_factor: at what share of their recorded velocity those were until now.
        """
        here = self._positions(frame)
        last = frame + 1 >= len(self._elapsed_s)
        after = here if last else self._positions(frame + 1, keep=False)
        lasts_s = 1.0 if last else self._elapsed_s[frame + 1] - self._elapsed_s[frame]
        share = (self._time_s - self._elapsed_s[frame]) / lasts_s if lasts_s > 0.0 else 0.0
        per_s = time_factor / lasts_s if lasts_s > 0.0 else 0.0
        for recorded_id, numbers in here.items():
            actor = self._cast.actor(recorded_id)
            if actor is None or actor.parent_id in self._world.actors:
                continue
            later = after.get(recorded_id, numbers)
            pose = _between(numbers, later, min(max(share, 0.0), 1.0))
            if recorded_id in newcomers:
                way_m = (later.astype(np.float64) - numbers) / CM_PER_M
                x, y, z, *_ = (way_m * per_s).tolist()
                self._world.put(actor.actor_id, pose, (x, y, z))
            else:
                self._world.set_pose(actor.actor_id, pose)

    def _positions(self, frame: int, *, keep: bool = True) -> Mapping[int, NDArray[np.float32]]:
        """Recorded poses of a frame by recorded id: six numbers in UE's units."""
        if self._poses[0] == frame:
            return self._poses[1]
        found = {
            int(row["id"]): np.concatenate([row["location"], row["rotation"]])
            for kind, payload in self._log.packets(frame)
            if kind == Packet.POSITION
            for row in records(Packet.POSITION, payload)
            if np.isfinite(row["location"]).all() and np.isfinite(row["rotation"]).all()
        }
        if keep:
            self._poses = (frame, found)
        return found

    def _follow(self) -> None:
        target = self._cast.actor(self._options.follow_id)
        if target is not None:
            pose = compose(self._world.actors.pose(target.actor_id), self._options.follow_offset)
            self._world.set_pose(self._world.spectator.actor_id, pose)


def _between(first: NDArray[np.float32], second: NDArray[np.float32], share: float) -> Pose:
    """A pose on the way from one to another; angles take the short way."""
    start, step = first.astype(np.float64), second.astype(np.float64) - first
    step[3:] = (step[3:] + 180.0) % 360.0 - 180.0
    return pose_of_ue((start + share * step).tolist())
