import { useState } from "react";
import { post, sentence } from "../api/client";
import type { RunSummary } from "../api/types";
import { href } from "../app/routes";
import { Icon } from "../ui/Icon";
import { isActive, stateOf } from "./states";

/** Name, state, and the button that stops: first after this frame, then at once. */
export function RunHead({ run }: { run: RunSummary }) {
  const [error, setError] = useState("");
  const { text, tone } = stateOf(run);
  const asked = run.stop ?? 0;
  const stop = () => {
    setError("");
    post(`/runs/${run.run_id}/stop`).catch((failure: unknown) => setError(sentence(failure)));
  };
  return (
    <header className="page-head">
      <h1>{run.name}</h1>
      <span className={`badge badge-${tone}`} role="status">
        {text}
      </span>
      <span className="muted mono run-id">{run.run_id}</span>
      <span className="spacer" />
      <a className="button" href={href({ page: "datasets", dataset: run.dataset })}>
        Open the dataset
      </a>
      {(isActive(run) || run.alive === "queued") && (
        <button
          type="button"
          className="button danger"
          title={asked > 0 ? "Ends it at once; the episode under way is lost" : "Finishes the frame; what is committed stays"}
          onClick={stop}
        >
          <Icon name="stop" /> {run.alive === "queued" ? "Take out" : asked > 0 ? "Stop at once" : "Stop"}
        </button>
      )}
      {error && (
        <p className="field-error" role="alert">
          {error}
        </p>
      )}
      {run.message && <p className="run-message">{run.message}</p>}
    </header>
  );
}
