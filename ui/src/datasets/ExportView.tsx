import { useState } from "react";
import { post, sentence } from "../api/client";
import { live } from "../api/live";
import { useAnswer } from "../api/useAnswer";
import type { ExportFormats, ExportRequest } from "../api/types";
import { useStore } from "../state/store";
import { Icon } from "../ui/Icon";
import { CommandButton } from "../ui/CommandDialog";
import { ExportsList } from "./ExportsList";
import { JobProgress } from "./JobProgress";

/** The dataset in another format, written next to it. */
export function ExportView({ base, dataset }: { base: string; dataset: string }) {
  const formats = useAnswer<ExportFormats>("/exports/formats");
  const jobs = useStore(live, (now) => now.jobs).filter((job) => job.kind === "export" && job.dataset === dataset);
  const [chosen, setChosen] = useState<string | null>(null);
  const [boxes, setBoxes] = useState<NonNullable<ExportRequest["boxes"]> | "">("");
  const [invisible, setInvisible] = useState(false);
  const [overwrite, setOverwrite] = useState(false);
  const [error, setError] = useState("");
  const list = formats.data?.formats ?? [];
  const format = chosen ?? list.find((one) => one.available)?.name ?? "";
  const request = { format, boxes: boxes || null, include_invisible: invisible, overwrite } as ExportRequest;
  const begin = () => {
    setError("");
    post(`${base}/export`, request).catch((failure: unknown) => setError(sentence(failure)));
  };
  return (
    <div className="export">
      <fieldset className="formats">
        <legend className="field-title">Format</legend>
        {list.map((one) => (
          <label key={one.name} className={`panel format${one.name === format ? " format-chosen" : ""}`}>
            <input
              type="radio"
              name="format"
              checked={one.name === format}
              disabled={!one.available}
              onChange={() => setChosen(one.name)}
            />
            <span>
              <b>{one.name}</b>
              <span className="muted">{one.title}</span>
              {!one.available && <span className="warn">needs the extra {one.extra}</span>}
            </span>
          </label>
        ))}
      </fieldset>
      <div className="export-options">
        <div className="inline-label">
          <label className="field-title" htmlFor="export-boxes">
            2D boxes
          </label>
          <select id="export-boxes" className="input compact" value={boxes} onChange={(event) => setBoxes(event.target.value as typeof boxes)}>
            <option value="">the format's own</option>
            <option value="amodal">amodal</option>
            <option value="modal">modal</option>
          </select>
        </div>
        <label className="inline-label">
          <input type="checkbox" checked={invisible} onChange={(event) => setInvisible(event.target.checked)} /> with invisible
          objects
        </label>
        <label className="inline-label">
          <input type="checkbox" checked={overwrite} onChange={(event) => setOverwrite(event.target.checked)} /> overwrite
        </label>
        <span className="spacer" />
        {format && <CommandButton command={{ do: "export", dataset, export: request }} />}
        <button type="button" className="button primary" disabled={!format} onClick={begin}>
          <Icon name="download" /> Export
        </button>
      </div>
      {error && (
        <p className="field-error" role="alert">
          {error}
        </p>
      )}
      <div className="jobs" aria-label="Exports" role="group">
        {jobs.map((job) => (
          <JobProgress key={job.job_id} job={job} />
        ))}
        {jobs.length === 0 && <p className="muted">Nothing has been exported from here yet.</p>}
      </div>
      <ExportsList />
    </div>
  );
}
