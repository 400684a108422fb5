import { useEffect, useRef, useState } from "react";
import { live } from "../api/live";
import type { RunSummary } from "../api/types";
import { useStore } from "../state/store";
import { clock, count } from "../ui/format";
import { isActive } from "./states";

const LEVELS = { all: ["debug", "info", "warning", "error"], warnings: ["warning", "error"] } as const;

/** What happened, newest at the end and visible, unless one has scrolled back. */
export function LogView({ run }: { run: RunSummary }) {
  const log = useStore(live, (now) => now.log);
  const [level, setLevel] = useState<keyof typeof LEVELS>("all");
  const list = useRef<HTMLOListElement>(null);
  const follow = useRef(true);
  const wanted: readonly string[] = LEVELS[level];
  const lines = log.filter((line) => wanted.includes(line.level));
  const warnings = log.filter((line) => line.level === "warning" || line.level === "error").length;
  useEffect(() => {
    if (follow.current && list.current) list.current.scrollTop = list.current.scrollHeight;
  }, [lines.length]);
  return (
    <section className="panel log" aria-label="Log">
      <header className="panel-head">
        <h2>Log</h2>
        {warnings > 0 && <span className="badge badge-warn">{count(warnings, "warning")}</span>}
        <span className="spacer" />
        <div className="segments small" role="group" aria-label="Lines to show">
          {(Object.keys(LEVELS) as (keyof typeof LEVELS)[]).map((one) => (
            <button key={one} type="button" className="segment" aria-pressed={one === level} onClick={() => setLevel(one)}>
              {one}
            </button>
          ))}
        </div>
      </header>
      <ol
        ref={list}
        className="log-lines"
        tabIndex={0}
        aria-label={`Log of ${run.name}`}
        onScroll={({ currentTarget: at }) => {
          follow.current = at.scrollHeight - at.scrollTop - at.clientHeight < 30;
        }}
      >
        {lines.map((line, i) => (
          <li key={i} className={`log-${line.level}`}>
            <time>{clock(line.time)}</time>
            <span>{line.text}</span>
          </li>
        ))}
        {lines.length === 0 && <li className="muted">{emptyLog(run, log.length)}</li>}
      </ol>
    </section>
  );
}

/** Why there is no line. */
function emptyLog(run: RunSummary, all: number): string {
  if (all > 0) return "There is neither a warning nor an error.";
  if (run.alive === "queued") return "It waits; the log begins with the run.";
  return isActive(run) ? "It has just begun." : "It has ended without a line.";
}
