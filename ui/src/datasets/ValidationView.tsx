import { useState } from "react";
import { post, sentence } from "../api/client";
import { live } from "../api/live";
import { useAnswer } from "../api/useAnswer";
import type { Validation } from "../api/types";
import { useStore } from "../state/store";
import { count, day } from "../ui/format";
import { Icon } from "../ui/Icon";
import { JobProgress } from "./JobProgress";

interface Report {
  ok: boolean;
  problems: { check: string; severity: string; episode?: string; frame?: number; sensor?: string; message: string }[];
  checks: Record<string, { rule: string; error: number; warning: number }>;
  figures: Record<string, unknown>;
}

/** The dataset's validation: everything is computed again from the files. */
export function ValidationView({ base, dataset, version }: { base: string; dataset: string; version: number }) {
  const jobs = useStore(live, (now) => now.jobs);
  const job = jobs.find((one) => one.kind === "validation" && one.dataset === dataset);
  const answer = useAnswer<Validation>(`${base}/validation`, `${version} ${job?.state}`);
  const [error, setError] = useState("");
  const running = job?.state === "running";
  const begin = () => {
    setError("");
    post(`${base}/validation`).catch((failure: unknown) => setError(sentence(failure)));
  };
  const report = answer.data?.report as Report | null | undefined;
  return (
    <div className="validation">
      <div className="page-head">
        <button type="button" className="button primary" disabled={running} onClick={begin}>
          <Icon name="check" /> {report ? "Validate again" : "Validate"}
        </button>
        {report && !running && (
          <span className={report.ok ? "good" : "bad"} role="status">
            <Icon name={report.ok ? "check" : "warn"} /> {report.ok ? "valid" : "not valid"}
            {answer.data?.state === "outdated" && ", before the newest episodes"}, {day(answer.data?.validated)}
          </span>
        )}
        {!report && !running && <span className="muted">Not validated yet: recomputes every promise from the files.</span>}
      </div>
      {running && <JobProgress job={job} />}
      {(error || job?.state === "failed") && (
        <p className="field-error" role="alert">
          {error || job?.error}
        </p>
      )}
      {report && <Checks report={report} />}
    </div>
  );
}

function Checks({ report }: { report: Report }) {
  const wrong = report.problems.length;
  return (
    <>
      {wrong > 0 && (
        <div className="panel table-scroll" tabIndex={0} role="region" aria-label="Problems">
          <table>
            <thead>
              <tr>
                <th>Check</th>
                <th>Where</th>
                <th>What</th>
              </tr>
            </thead>
            <tbody>
              {report.problems.map((one, i) => (
                <tr key={i}>
                  <td className={one.severity === "error" ? "bad" : "warn"}>{one.check}</td>
                  <td>{[one.episode, one.frame === undefined || one.frame === null ? null : `frame ${one.frame}`, one.sensor].filter(Boolean).join(", ")}</td>
                  <td>{one.message}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
      <h3>{count(Object.keys(report.checks).length, "check")}</h3>
      <ul className="checks">
        {Object.entries(report.checks).map(([name, check]) => (
          <li key={name} title={check.rule}>
            <span className={check.error > 0 ? "bad" : check.warning > 0 ? "warn" : "good"}>
              <Icon name={check.error + check.warning > 0 ? "warn" : "check"} />
            </span>
            <span className="mono">{name}</span>
            <span className="muted">{check.rule}</span>
          </li>
        ))}
      </ul>
    </>
  );
}
