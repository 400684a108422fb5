import { useState } from "react";
import { post, sentence } from "../api/client";
import { live } from "../api/live";
import type { Job } from "../api/types";
import { useStore } from "../state/store";
import { JobProgress } from "../datasets/JobProgress";
import { Icon } from "../ui/Icon";

interface Props {
  dataset: string;
  episode: string;
}

type Viewer = "Foxglove" | "Rerun";
/** How each opens a file of this machine; nothing is sent anywhere. */
const COMMANDS: Record<Viewer, (path: string) => string> = {
  Foxglove: (path) => `foxglove-studio ${path}`,
  Rerun: (path) => `rerun ${path}`,
};

/** The episode for another viewer: one press exports it as MCAP, and says how it is opened there. */
export function HandOver({ dataset, episode }: Props) {
  const [viewer, setViewer] = useState<Viewer | null>(null);
  const [id, setId] = useState<string | null>(null);
  const [error, setError] = useState("");
  const job = useStore(live, (now) => now.jobs).find((one) => one.job_id === id);
  const begin = (next: Viewer) => {
    setViewer(next);
    setError("");
    if (job && job.state !== "failed" && job.state !== "cancelled") return; // the file is the same
    const out = `${dataset.replaceAll("~", "-")}-${episode.slice(0, 24)}-mcap`;
    post<Job>(`/datasets/${encodeURIComponent(dataset)}/export`, { format: "mcap", out, overwrite: true, episodes: [episode] }).then(
      (begun) => setId(begun.job_id),
      (failure: unknown) => setError(sentence(failure)),
    );
  };
  const path = (job?.result as { path?: string } | null | undefined)?.path;
  const file = path ? `${path}/${episode}.mcap` : null;
  return (
    <div className="hand-over" role="group" aria-label="Other viewers">
      {(Object.keys(COMMANDS) as Viewer[]).map((name) => (
        <button key={name} type="button" className="button small" aria-pressed={name === viewer} onClick={() => begin(name)}>
          <Icon name="expand" /> {name}
        </button>
      ))}
      {error && (
        <p className="field-error" role="alert">
          {error}
        </p>
      )}
      {job && job.state !== "done" && <JobProgress job={job} />}
      {viewer && file && job?.state === "done" && (
        <p className="panel hand-over-note" role="status">
          {file} is written, below the folder of the datasets. Open it in {viewer} with{" "}
          <code>{COMMANDS[viewer](file)}</code>
          {viewer === "Foxglove" ? ", or drop the file on its window. layout.json beside it is a layout with all cameras, points and the map." : "."}
        </p>
      )}
    </div>
  );
}
