import { useEffect, useState } from "react";
import type { RunSummary } from "../api/types";
import { bytes, duration, percent } from "../ui/format";
import { isActive } from "./states";

/** How far, how fast, how long still. */
export function Progress({ run }: { run: RunSummary }) {
  const now = useNow(isActive(run));
  const { total = 0, committed = 0, failed = 0, skipped = 0 } = run.episodes;
  const { current } = run;
  const over = !isActive(run);
  const until = run.ended ?? (over ? null : now);
  const elapsed = run.started && until ? until - run.started : null;
  const attempt = Number(current?.attempt.replace(/^a/, "") ?? 1);
  return (
    <section className="panel progress" aria-label="Progress">
      <div className="bars">
        <Bar name="Whole run" share={run.progress ?? 0} text={percent(run.progress ?? 0)} />
        <Bar
          name={current ? `Episode ${current.index + 1} of ${total}, recorded${attempt > 1 ? `, attempt ${attempt}` : ""}` : "Episodes"}
          share={current ? ratio(current.ticks_done, current.ticks_total) : ratio(committed + skipped, total)}
          text={current ? `${current.ticks_done ?? 0} / ${current.ticks_total ?? 0} steps` : `${committed + skipped} / ${total}`}
        />
        {current && (
          <Bar
            name="Converted and labelled"
            share={ratio(current.frames_converted, current.frames_total)}
            text={`${current.frames_converted ?? 0} / ${current.frames_total ?? 0} frames`}
          />
        )}
        {run.again && current && (
          <p className="attempt" role="status">
            <span className="badge badge-warn">attempt {attempt}</span> Episode {current.index + 1} is recorded again:{" "}
            {run.again}
          </p>
        )}
      </div>
      <dl className="tiles">
        <Tile name="Rate" value={run.rate_ticks_s ? `${run.rate_ticks_s.toFixed(1)} steps/s` : "–"} />
        <Tile name={over ? "Took" : "Elapsed"} value={duration(elapsed)} />
        <Tile name="Time left" value={isActive(run) ? duration(run.eta_s) : "–"} />
        <Tile name="Committed" value={`${committed} of ${total}`} />
        <Tile name="Failed" value={String(failed)} tone={failed > 0 ? "bad" : ""} />
        <Tile name="Disk free" value={bytes(run.disk_free_bytes)} />
      </dl>
    </section>
  );
}

function ratio(done: number | undefined, total: number | undefined): number {
  return total ? Math.min(1, (done ?? 0) / total) : 0;
}

function Bar({ name, share, text }: { name: string; share: number; text: string }) {
  return (
    <div className="bar-row">
      <span className="bar-name">{name}</span>
      <div
        className="bar"
        role="progressbar"
        aria-label={name}
        aria-valuemin={0}
        aria-valuemax={100}
        aria-valuenow={Math.round(share * 100)}
        aria-valuetext={text}
      >
        <span style={{ width: `${share * 100}%` }} />
      </div>
      <span className="bar-text">{text}</span>
    </div>
  );
}

function Tile({ name, value, tone = "" }: { name: string; value: string; tone?: string }) {
  return (
    <div className="tile">
      <dt>{name}</dt>
      <dd className={tone}>{value}</dd>
    </div>
  );
}

/** Unix time, each second anew while something goes on. */
function useNow(going: boolean): number {
  const [now, setNow] = useState(Date.now() / 1000);
  useEffect(() => {
    if (!going) return;
    const timer = window.setInterval(() => setNow(Date.now() / 1000), 1000);
    return () => window.clearInterval(timer);
  }, [going]);
  return now;
}
