import { post, sentence } from "../api/client";
import type { Job } from "../api/types";
import { count } from "../ui/format";

/** How far an export or a validation is; ends it on request. */
export function JobProgress({ job }: { job: Job }) {
  const { done = 0, total = 0 } = job;
  const share = total > 0 ? done / total : 0;
  const result = job.result as { path?: string; out?: string; warnings?: string[] } | null | undefined;
  return (
    <div className="job" data-state={job.state}>
      <b>{job.title}</b>
      {job.state === "running" ? (
        <>
          <div className="bar" role="progressbar" aria-label={job.title} aria-valuenow={Math.round(share * 100)} aria-valuemin={0} aria-valuemax={100}>
            <span style={{ width: `${share * 100}%` }} />
          </div>
          <span className="muted">
            {job.phase} {total > 0 ? `${done} of ${count(total, "frame")}` : ""}
          </span>
          <button
            type="button"
            className="button small"
            onClick={() => void post(`/jobs/${job.job_id}/cancel`).catch((error: unknown) => console.info(sentence(error)))}
          >
            Cancel
          </button>
        </>
      ) : (
        <span className={job.state === "done" ? "good" : "bad"} role="status">
          {job.state}
          {job.error ? `: ${job.error}` : ""}
          {result?.path || result?.out ? `: ${String(result.path ?? result.out)}` : ""}
        </span>
      )}
      {result?.warnings?.map((warning) => (
        <span key={warning} className="warn">
          {warning}
        </span>
      ))}
    </div>
  );
}
