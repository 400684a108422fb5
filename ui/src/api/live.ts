import { createStore } from "../state/store";
import type { Channel, ClientMessage, ConfigState, DriveMessage, Job, LiveMessage, LoadPoint, LogLine, RunSummary, TickPoint } from "./types";

/** What the server sends unasked: runs, the watched run's log and ticks, jobs. */
export interface Live {
  connection: "connecting" | "online" | "offline";
  runs: readonly RunSummary[];
  watched: string | null;
  log: readonly LogLine[];
  ticks: readonly TickPoint[];
  loads: readonly LoadPoint[];
  channels: readonly Channel[];
  jobs: readonly Job[];
  /** Grows whenever lists of datasets are to be asked for anew. */
  datasetsVersion: number;
}

/** The newest picture of a channel. */
export interface Picture {
  tick: number;
  data: ArrayBuffer;
}

const MOST_LINES = 2000;
/** As many as the server keeps. */
export const MOST_POINTS = 3000;
const GOLDEN = (Math.sqrt(5) - 1) / 2;
const FIRST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 4000;
const HEADER_BYTES = 8;
const MOST_WAITING_BYTES = 4096;

export const live = createStore<Live>({
  connection: "connecting",
  runs: [],
  watched: null,
  log: [],
  ticks: [],
  loads: [],
  channels: [],
  jobs: [],
  datasetsVersion: 0,
});

/** Newest picture by sensor of the watched run; kept apart from the store, for it changes often. */
const pictures = new Map<string, Picture>();
const pictureListeners = new Map<string, Set<(picture: Picture) => void>>();

let socket: WebSocket | null = null;
let wanted: { run: string | null; previews: boolean } = { run: null, previews: false };
let onConfig: (config: ConfigState, first: boolean) => void = () => undefined;

/** Connect, and stay connected. `config` is called with each configuration that comes. */
export function connect(config: (state: ConfigState, first: boolean) => void): void {
  onConfig = config;
  open(FIRST_WAIT_MS);
  // A hidden tab needs no pictures.
  document.addEventListener("visibilitychange", sendWatch);
}

function open(wait: number): void {
  const address = new URL("api/live", document.baseURI);
  address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
  address.hash = "";
  const made = new WebSocket(address);
  made.binaryType = "arraybuffer";
  socket = made;
  let next = wait;
  made.onopen = () => {
    next = FIRST_WAIT_MS;
    live.set((now) => ({ ...now, connection: "online" }));
    sendWatch();
  };
  made.onmessage = ({ data }: MessageEvent<string | ArrayBuffer>) => {
    if (typeof data === "string") receive(JSON.parse(data) as LiveMessage);
    else receivePicture(data);
  };
  made.onclose = () => {
    live.set((now) => ({ ...now, connection: "offline" }));
    window.setTimeout(() => open(Math.min(next * 1.6, LONGEST_WAIT_MS)), next);
  };
}

/** Watch a run, and its pictures where they are shown. */
export function watch(run: string | null, previews: boolean): void {
  if (run !== wanted.run) {
    pictures.clear();
    live.set((now) => ({ ...now, watched: run, log: [], ticks: [], loads: [], channels: [] }));
  }
  wanted = { run, previews };
  sendWatch();
}

function sendWatch(): void {
  if (socket?.readyState !== WebSocket.OPEN) return;
  const message: ClientMessage = {
    type: "watch",
    run_id: wanted.run,
    previews: wanted.previews && document.visibilityState === "visible",
  };
  socket.send(JSON.stringify(message));
}

/** Send what is pressed; whether it went: nothing waits for a slow connection. */
export function sendDrive(message: DriveMessage): boolean {
  if (socket?.readyState !== WebSocket.OPEN || socket.bufferedAmount > MOST_WAITING_BYTES) return false;
  socket.send(JSON.stringify(message));
  return true;
}

function receive(message: LiveMessage): void {
  switch (message.type) {
    case "snapshot":
      live.set((now) => ({
        ...now,
        runs: message.runs,
        jobs: message.jobs,
        datasetsVersion: now.datasetsVersion + 1,
      }));
      onConfig(message.config, true);
      return;
    case "config":
      onConfig(message.config, false);
      return;
    case "runs":
      live.set((now) => ({ ...now, runs: message.runs }));
      return;
    case "run":
      live.set((now) => ({
        ...now,
        runs: now.runs.map((run) => (run.run_id === message.run_id ? message.run : run)),
      }));
      return;
    case "log":
      if (message.run_id === wanted.run)
        live.set((now) => ({ ...now, log: [...(message.reset ? [] : now.log), ...message.lines].slice(-MOST_LINES) }));
      return;
    case "ticks":
      if (message.run_id === wanted.run)
        live.set((now) => ({
          ...now,
          ticks: thinned([...(message.reset ? [] : now.ticks), ...message.ticks]),
          loads: thinned([...(message.reset ? [] : now.loads), ...(message.loads ?? [])]),
        }));
      return;
    case "channels":
      if (message.run_id === wanted.run) live.set((now) => ({ ...now, channels: message.channels }));
      return;
    case "job":
      live.set((now) => ({ ...now, jobs: withJob(now.jobs, message.job) }));
      return;
    case "datasets":
      live.set((now) => ({ ...now, datasetsVersion: now.datasetsVersion + 1 }));
  }
}

/**
 * About half of the points of a series that has become too long, as the server thins its own: evenly over
 * the run, and without losing one of two workers that take turns.
 */
export function thinned<T>(points: readonly T[]): readonly T[] {
  if (points.length <= MOST_POINTS) return points;
  return thinned(points.filter((_, index) => (index * GOLDEN) % 1 < 0.5));
}

export function withJob(jobs: readonly Job[], job: Job): readonly Job[] {
  const known = jobs.some((one) => one.job_id === job.job_id);
  return known ? jobs.map((one) => (one.job_id === job.job_id ? job : one)) : [job, ...jobs];
}

function receivePicture(data: ArrayBuffer): void {
  const header = new DataView(data, 0, HEADER_BYTES);
  const number = header.getUint8(0);
  const channel = live.get().channels.find((one) => one.channel === number);
  if (!channel) return;
  const picture = { tick: header.getUint32(4, true), data: data.slice(HEADER_BYTES) };
  pictures.set(channel.sensor_id, picture);
  for (const listener of pictureListeners.get(channel.sensor_id) ?? []) listener(picture);
}

/** Call a listener with each picture of a sensor, the newest known one at once. */
export function onPicture(sensor: string, listener: (picture: Picture) => void): () => void {
  const listeners = pictureListeners.get(sensor) ?? new Set();
  pictureListeners.set(sensor, listeners);
  listeners.add(listener);
  const known = pictures.get(sensor);
  if (known) listener(known);
  return () => listeners.delete(listener);
}
