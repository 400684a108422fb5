import { useState } from "react";
import { post, sentence } from "../api/client";
import { live } from "../api/live";
import { useAnswer } from "../api/useAnswer";
import type { ReportState } from "../api/types";
import { useStore } from "../state/store";
import { day } from "../ui/format";
import { CommandButton } from "../ui/CommandDialog";
import { Icon } from "../ui/Icon";
import { JobProgress } from "./JobProgress";

/** The report: pictures with labels, maps, statistics and the verdict, as one page on its own. */
export function ReportView({ base, dataset, version }: { base: string; dataset: string; version: number }) {
  const job = useStore(live, (now) => now.jobs).find((one) => one.kind === "report" && one.dataset === dataset);
  const answer = useAnswer<ReportState>(`${base}/report`, `${version} ${job?.state}`);
  const [error, setError] = useState("");
  const running = job?.state === "running";
  const state = answer.data?.state;
  const there = state === "current" || state === "outdated";
  const page = `api${base}/report.html?made=${answer.data?.made ?? 0}`;
  const begin = () => {
    setError("");
    post(`${base}/report`).catch((failure: unknown) => setError(sentence(failure)));
  };
  return (
    <div className="report">
      <div className="page-head">
        <button type="button" className={`button${there ? "" : " primary"}`} disabled={running} onClick={begin}>
          <Icon name="eye" /> {there ? "Write it again" : "Write the report"}
        </button>
        <CommandButton command={{ do: "report", dataset }} />
        {there && (
          <>
            <span className="muted">
              {day(answer.data?.made)}
              {state === "outdated" && ", before the newest episodes"}
            </span>
            <a className="button" href={page} download={`${dataset}-report.html`}>
              <Icon name="download" /> Download
            </a>
          </>
        )}
        {state === "none" && !running && (
          <span className="muted">Frames with boxes, points and masks, maps, statistics and the verdict, in one file.</span>
        )}
      </div>
      {running && <JobProgress job={job} />}
      {(error || job?.state === "failed" || answer.error) && (
        <p className="field-error" role="alert">
          {error || job?.error || answer.error}
        </p>
      )}
      {there && !running && <iframe className="report-page" title={`Report of ${dataset}`} src={page} sandbox="" />}
    </div>
  );
}
