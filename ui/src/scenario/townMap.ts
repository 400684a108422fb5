import { useEffect, useState } from "react";
import { post, sentence } from "../api/client";
import type { TownMap } from "../api/types";
import type { Json } from "../state/json";

/** A place on a road with the lane's heading; metres and degrees, CARLA's axes. */
export interface Place {
  x: number;
  y: number;
  z: number;
  yaw_deg: number;
}

/** How far beside a lane's centre a press still means the lane. */
const BESIDE_M = 6;
/** A place of one's own needs to be a little above the road. */
const ABOVE_M = 0.3;

/** The map from above that a server has, as far as it is known; asked anew when either changes. */
export function useTownMap(server: Json | undefined, map: string | null): { town: TownMap | null; note: string } {
  const key = JSON.stringify({ server: server ?? { kind: "embedded" }, map });
  const [answer, setAnswer] = useState<{ key: string; town: TownMap | null; note: string } | null>(null);
  useEffect(() => {
    const stop = new AbortController();
    const asked = JSON.parse(key) as { map: string | null };
    if (asked.map === null) return;
    post<TownMap>("/map", asked, stop.signal).then(
      (town) => setAnswer({ key, town, note: town.note ?? "" }),
      (error: unknown) => {
        if (!stop.signal.aborted) setAnswer({ key, town: null, note: sentence(error) });
      },
    );
    return () => stop.abort();
  }, [key]);
  return answer?.key === key ? answer : { town: null, note: map === null ? "No map is chosen." : "Loading the map…" };
}

/** The nearest place on a lane, with its height and heading; null where no lane is near. */
export function placeOnRoad(town: TownMap, x: number, y: number): Place | null {
  let best: Place | null = null;
  let nearest = BESIDE_M;
  (town.lanes ?? []).forEach((lane, at) => {
    const heights = town.lane_heights_m?.[at] ?? [];
    for (let i = 0; i + 1 < lane.length; i += 1) {
      const [ax = 0, ay = 0] = lane[i] ?? [];
      const [bx = 0, by = 0] = lane[i + 1] ?? [];
      const [dx, dy] = [bx - ax, by - ay];
      const squared = dx * dx + dy * dy;
      if (squared === 0) continue;
      const share = Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / squared));
      const away = Math.hypot(x - ax - share * dx, y - ay - share * dy);
      if (away >= nearest) continue;
      nearest = away;
      const [az, bz] = [heights[i] ?? 0, heights[i + 1] ?? 0];
      best = {
        x: rounded(ax + share * dx),
        y: rounded(ay + share * dy),
        z: rounded(az + share * (bz - az) + ABOVE_M),
        yaw_deg: rounded((Math.atan2(dy, dx) * 180) / Math.PI),
      };
    }
  });
  return best;
}

/** The number of the spawn point that is nearest to a place, within some metres. */
export function nearestSpawn(points: readonly (readonly number[])[], x: number, y: number, within: number): number | null {
  let best: number | null = null;
  let nearest = within;
  points.forEach(([px = 0, py = 0], i) => {
    const away = Math.hypot(px - x, py - y);
    if (away > nearest) return;
    [best, nearest] = [i, away];
  });
  return best;
}

/** The next point in a direction, y down: near in it rather than beside it; the same where there is none. */
export function neighbour(points: readonly (readonly number[])[], from: number, [dx, dy]: readonly [number, number]): number {
  const [fx = 0, fy = 0] = points[from] ?? [];
  let best = from;
  let least = Infinity;
  points.forEach(([px = 0, py = 0], i) => {
    const along = (px - fx) * dx + (py - fy) * dy;
    const across = Math.abs((px - fx) * dy - (py - fy) * dx);
    const far = along + 2 * across;
    if (i === from || along <= 0.01 || across > 2 * along || far >= least) return;
    [best, least] = [i, far];
  });
  return best;
}

function rounded(value: number): number {
  return Math.round(value * 100) / 100;
}
