import { useCallback, useEffect, useRef, useState } from "react";
import { get, sentence } from "../api/client";
import type { FrameMessage } from "../api/types";

export interface Player {
  /** The frame that is asked for. */
  k: number;
  /** The newest frame that has come. */
  frame: FrameMessage | null;
  error: string | null;
  playing: boolean;
  speed: number;
  seek(k: number): void;
  toggle(): void;
  setSpeed(speed: number): void;
}

const MOST_KEPT = 60;
const AHEAD = 3;

/** Frames of an episode: the one that is shown, and the next ones fetched ahead while playing. */
export function usePlayer(base: string, count: number, fps: number): Player {
  const [k, setK] = useState(0);
  const [frame, setFrame] = useState<FrameMessage | null>(null);
  const [error, setError] = useState<string | null>(null);
  const [playing, setPlaying] = useState(false);
  const [speed, setSpeed] = useState(1);
  const kept = useRef(new Map<number, Promise<FrameMessage>>());

  const fetched = useCallback(
    (at: number): Promise<FrameMessage> => {
      const known = kept.current.get(at);
      if (known) return known;
      const asked = get<FrameMessage>(`${base}/frames/${at}`);
      kept.current.set(at, asked);
      asked.catch(() => kept.current.delete(at));
      for (const old of [...kept.current.keys()].slice(0, -MOST_KEPT)) kept.current.delete(old);
      return asked;
    },
    [base],
  );

  useEffect(() => {
    if (count === 0) return;
    let wanted = true;
    const began = performance.now();
    let timer: number | undefined;
    fetched(k).then(
      (answer) => {
        if (!wanted) return;
        setFrame(answer);
        setError(null);
        if (!playing) return;
        for (let ahead = 1; ahead <= AHEAD && k + ahead < count; ahead += 1) void fetched(k + ahead).catch(() => null);
        const wait = Math.max(0, 1000 / (fps * speed) - (performance.now() - began));
        timer = window.setTimeout(() => (k + 1 < count ? setK(k + 1) : setPlaying(false)), wait);
      },
      (failure: unknown) => {
        if (!wanted) return;
        setError(sentence(failure));
        setPlaying(false);
      },
    );
    return () => {
      wanted = false;
      window.clearTimeout(timer);
    };
  }, [k, playing, speed, fps, count, fetched]);

  const seek = useCallback(
    (at: number) => {
      setPlaying(false);
      setK(Math.min(Math.max(0, at), Math.max(0, count - 1)));
    },
    [count],
  );
  const toggle = useCallback(() => {
    setK((now) => (now >= count - 1 ? 0 : now));
    setPlaying((now) => !now);
  }, [count]);
  return { k, frame, error, playing, speed, seek, toggle, setSpeed };
}
