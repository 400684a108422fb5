import { useCallback, useEffect, useMemo, useRef, useState } from "react";
import { sentence } from "../api/client";
import { FrameLoader, type Bundle, type Wanted } from "./frameLoader";

export interface Player {
  /** The frame that is asked for. */
  k: number;
  /** The newest frame that has come, with all that is shown of it. */
  bundle: Bundle | null;
  error: string | null;
  playing: boolean;
  speed: number;
  seek(k: number): void;
  toggle(): void;
  setSpeed(speed: number): void;
}

const AHEAD = 3;

interface Asked {
  k: number;
  wanted: Wanted;
}

/** Does one thing after the other; of what is asked for meanwhile, only the newest. */
class NewestOnly {
  private goal: Asked | null = null;
  private busy = false;

  constructor(private readonly work: (asked: Asked) => Promise<void>) {}

  async ask(asked: Asked): Promise<void> {
    this.goal = asked;
    if (this.busy) return;
    this.busy = true;
    while (this.goal) {
      const next: Asked = this.goal;
      this.goal = null;
      await this.work(next);
    }
    this.busy = false;
  }

  stop(): void {
    this.goal = null;
  }
}

interface Answer {
  loader: FrameLoader;
  bundle: Bundle | null;
  error: string | null;
}

/**
 * The frame `k` of an episode. While one is on its way, only the newest of the others is asked for
 * next: a hand that scrubs sees as many frames as can be loaded, and never waits for old ones.
 */
export function useBundle(base: string, k: number | null, count: number, wanted: Wanted): Omit<Answer, "loader"> {
  const [answer, setAnswer] = useState<Answer | null>(null);
  const { loader, newest } = useMemo(() => {
    const loader = new FrameLoader(base);
    let last = 0;
    const newest = new NewestOnly(async (asked) => {
      try {
        const bundle = await loader.load(asked.k, asked.wanted);
        setAnswer({ loader, bundle, error: null });
        ahead(loader, last, asked, count);
        last = asked.k;
      } catch (error) {
        setAnswer({ loader, bundle: null, error: sentence(error) });
      }
    });
    return { loader, newest };
  }, [base, count]);
  const key = JSON.stringify(wanted);
  useEffect(() => {
    if (k !== null && count > 0) void newest.ask({ k, wanted: JSON.parse(key) as Wanted });
  }, [newest, k, count, key]);
  useEffect(() => () => newest.stop(), [newest]);
  return answer?.loader === loader ? answer : { bundle: null, error: null };
}

/** The next frames in the direction of the last step, so that they are there when they are due. */
function ahead(loader: FrameLoader, before: number, { k, wanted }: Asked, count: number): void {
  const step = k - before;
  if (Math.abs(step) > AHEAD) return;
  const way = step < 0 ? -1 : 1;
  for (let i = 1; i <= AHEAD; i += 1) {
    const at = k + way * i;
    if (at >= 0 && at < count) loader.load(at, wanted).catch((error: unknown) => console.info("fetching ahead", sentence(error)));
  }
}

/** Plays and seeks in an episode. */
export function usePlayer(base: string, count: number, fps: number, first: number, wanted: Wanted): Player {
  const [k, setK] = useState(Math.min(first, Math.max(0, count - 1)));
  const [playing, setPlaying] = useState(false);
  const [speed, setSpeed] = useState(1);
  const { bundle, error } = useBundle(base, k, count, wanted);
  const due = useRef(0);

  useEffect(() => {
    if (!playing || (bundle?.k !== k && !error)) return;
    const now = performance.now();
    // Steady as long as frames come in time; where they do not, nothing is made up for.
    due.current = Math.max(now, due.current + 1000 / (fps * speed));
    const timer = window.setTimeout(() => (k + 1 < count && !error ? setK(k + 1) : setPlaying(false)), due.current - now);
    return () => window.clearTimeout(timer);
  }, [bundle, k, playing, speed, fps, count, error]);

  const seek = useCallback(
    (at: number) => {
      setPlaying(false);
      setK(Math.min(Math.max(0, at), Math.max(0, count - 1)));
    },
    [count],
  );
  const toggle = useCallback(() => {
    due.current = performance.now();
    setK((now) => (now >= count - 1 ? 0 : now));
    setPlaying((now) => !now);
  }, [count]);
  return { k, bundle, error, playing, speed, seek, toggle, setSpeed };
}
