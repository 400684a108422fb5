import { useState } from "react";
import { post, sentence } from "../api/client";
import type { RunSummary } from "../api/types";
import { href } from "../app/routes";
import { Place } from "../ui/CopyText";
import { Icon } from "../ui/Icon";
import { RunActions } from "./RunActions";
import { isActive, mayHaveDataset, stateOf } from "./states";

/** Name, state, and the button that stops: first after this frame, then at once. */
export function RunHead({ run }: { run: RunSummary }) {
  const [error, setError] = useState("");
  const { text, tone } = stateOf(run);
  const asked = run.stop ?? 0;
  const stop = (clicks: number) => {
    if (clicks > 1) return; // a double click is one press: the second would end the run at once
    setError("");
    post(`/runs/${run.run_id}/stop`, { seen: asked }).catch((failure: unknown) => setError(sentence(failure)));
  };
  return (
    <header className="page-head">
      <h1>{run.name}</h1>
      <span className={`badge badge-${tone}`} role="status">
        {text}
      </span>
      <span className="muted mono run-id">{run.run_id}</span>
      {run.continues && (
        <a className="muted" href={href({ page: "run", run: run.continues })}>
          goes on with {run.continues}
        </a>
      )}
      <span className="spacer" />
      {mayHaveDataset(run) && (
        <a className="button" href={href({ page: "datasets", dataset: run.dataset })}>
          Open the dataset
        </a>
      )}
      {(isActive(run) || run.alive === "queued") && (
        <button
          type="button"
          className="button danger"
          title={asked > 0 ? "Ends it at once; the episode under way is lost" : "Finishes the frame; what is committed stays"}
          onClick={(event) => stop(event.detail)}
        >
          <Icon name="stop" /> {run.alive === "queued" ? "Take out" : asked > 0 ? "Stop at once" : "Stop"}
        </button>
      )}
      <RunActions run={run} onError={setError} />
      {error && (
        <p className="field-error" role="alert">
          {error}
        </p>
      )}
      <RunMessage run={run} />
      <p className="run-place">
        <span className="muted">Dataset</span> <Place location={run.location ?? ""} name="the dataset's place" />
        {run.folder && (
          <>
            <span className="muted">Logs</span> <Place location={run.folder} name="the run's folder" />
          </>
        )}
      </p>
    </header>
  );
}

/** Why it is as it is: an error as an error, all else as a note. */
function RunMessage({ run }: { run: RunSummary }) {
  const dead = run.alive === "dead" ? "Its process is gone; it has not said why. " : "";
  const text = `${dead}${run.message ?? ""}`;
  if (!text) return null;
  const bad = run.state === "failed" || run.alive === "dead";
  return (
    <p className={bad ? "run-message run-error" : "run-message"} role={bad ? "alert" : undefined}>
      {bad && <Icon name="warn" />} {text}
    </p>
  );
}
