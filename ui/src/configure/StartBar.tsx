import { useState } from "react";
import { goTo } from "../app/routes";
import { live } from "../api/live";
import { ApiError, post, sentence } from "../api/client";
import type { RunSummary } from "../api/types";
import { draft, problemsOf, settled, standing } from "../state/draft";
import { pathText } from "../state/json";
import { useStore } from "../state/store";
import { bytes, count, duration } from "../ui/format";
import { Icon } from "../ui/Icon";

/** What the run will cost, and the button that begins it. */
export function StartBar() {
  const now = useStore(draft, (value) => value);
  const { estimate, warnings, history } = now;
  const problems = problemsOf(now);
  const saved = standing(now);
  const runs = useStore(live, (now) => now.runs);
  const [error, setError] = useState("");
  const [others, setOthers] = useState(false);
  const [busy, setBusy] = useState(false);
  const named = typeof history.present.name === "string" ? history.present.name : "quickstart";
  const suggested = named.trim().replace(/[^A-Za-z0-9_.-]+/g, "-").replace(/^[^A-Za-z0-9]+/, "") || "dataset";
  const [folder, setFolder] = useState<string | null>(null);
  const dataset = folder ?? suggested;
  const ahead = runs.filter((run) => run.alive === "running" || run.alive === "queued").length;

  const start = async (append = false) => {
    setBusy(true);
    setError("");
    setOthers(false);
    try {
      const rev = await settled();
      const run = await post<RunSummary>("/runs", { dataset, rev, append });
      goTo({ page: "run", run: run.run_id });
    } catch (failure) {
      setError(failure instanceof ApiError ? failure.message : sentence(failure));
      setOthers(failure instanceof ApiError && failure.answer.code === "other_settings");
    } finally {
      setBusy(false);
    }
  };
  const wrong = problems.length > 0;
  return (
    <footer className="start-bar" data-saved={saved}>
      <div className="estimate" role="status" aria-live="polite">
        {wrong ? (
          <span className="bad">
            <Icon name="warn" /> {count(problems.length, "problem")}: {pathText(problems[0]?.path ?? []) || "configuration"}
          </span>
        ) : estimate ? (
          <>
            <span>
              <b>{count(estimate.frames, "frame")}</b> in {count(estimate.episodes, "episode")}
            </span>
            <span className={estimate.fits ? "" : "bad"}>
              <b>{bytes(estimate.dataset_bytes)}</b> of {bytes(estimate.disk_free_bytes)} free
            </span>
            <span>
              about <b>{duration(estimate.duration_s)}</b>
            </span>
          </>
        ) : (
          <span className="muted">checking…</span>
        )}
        {saved === "offline" && <span className="bad">not saved: the server does not answer</span>}
      </div>
      {warnings.length > 0 && !wrong && (
        <details className="warnings">
          <summary>{count(warnings.length, "hint")}</summary>
          <ul>
            {warnings.map((one) => (
              <li key={one}>{one}</li>
            ))}
          </ul>
        </details>
      )}
      <div className="start-row">
        <label className="folder">
          <span className="field-title">Dataset folder</span>
          <input
            className="input"
            value={dataset}
            spellCheck={false}
            onChange={(event) => {
              setFolder(event.target.value || null);
              setOthers(false);
              setError("");
            }}
          />
        </label>
        <button
          type="button"
          className="button primary start"
          disabled={wrong || busy || saved === "wrong"}
          onClick={() => void start()}
        >
          <Icon name="play" /> {ahead > 0 ? "Queue" : "Start"}
        </button>
      </div>
      {error && (
        <p className="field-error" role="alert">
          {error}
        </p>
      )}
      {others && (
        <div className="button-row">
          <button type="button" className="button small" disabled={busy} onClick={() => void start(true)}>
            Record all the same
          </button>
        </div>
      )}
    </footer>
  );
}
