import { useState } from "react";
import { post, sentence } from "../api/client";
import { live } from "../api/live";
import { useAnswer } from "../api/useAnswer";
import type { EpisodeSummary, Validation } from "../api/types";
import { href } from "../app/routes";
import { useStore } from "../state/store";
import { count, day } from "../ui/format";
import { CommandButton } from "../ui/CommandDialog";
import { Icon } from "../ui/Icon";
import { JobProgress } from "./JobProgress";

interface Report {
  ok: boolean;
  problems: { check: string; severity: string; episode?: string; frame?: number; sensor?: string; message: string }[];
  checks: Record<string, { rule: string; error: number; warning: number }>;
  figures: Record<string, unknown>;
}

type Problem = Report["problems"][number];

interface Props {
  base: string;
  dataset: string;
  episodes: readonly EpisodeSummary[];
  version: number;
}

/** The dataset's validation: everything is computed again from the files. */
export function ValidationView({ base, dataset, episodes, version }: Props) {
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
        <CommandButton command={{ do: "validate", dataset }} />
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
      {report && <Checks report={report} dataset={dataset} episodes={episodes} />}
    </div>
  );
}

interface ChecksProps {
  report: Report;
  dataset: string;
  episodes: readonly EpisodeSummary[];
}

function Checks({ report, dataset, episodes }: ChecksProps) {
  const wrong = report.problems.length;
  const [only, setOnly] = useState<string | null>(null);
  const kinds = [...new Set(report.problems.map((one) => one.check))];
  const shown = report.problems
    .filter((one) => only === null || one.check === only)
    .sort((a, b) => Number(b.severity === "error") - Number(a.severity === "error"));
  return (
    <>
      {kinds.length > 1 && (
        <div className="class-legend" role="group" aria-label="Problems of a check">
          {kinds.map((check) => (
            <button key={check} type="button" className="chip" aria-pressed={check === only} onClick={() => setOnly(check === only ? null : check)}>
              {check} <span className="muted">{report.problems.filter((one) => one.check === check).length}</span>
            </button>
          ))}
        </div>
      )}
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
              {shown.map((one, i) => (
                <tr key={i}>
                  <td className={one.severity === "error" ? "bad" : "warn"}>
                    {one.severity}: {one.check}
                  </td>
                  <td>
                    <Place problem={one} dataset={dataset} episodes={episodes} />
                  </td>
                  <td className="said">{one.message}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
      <h2>{count(Object.keys(report.checks).length, "check")}</h2>
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

/** Where a problem is, as the way there: its frame, seen through its sensor. */
function Place({ problem, dataset, episodes }: { problem: Problem; dataset: string; episodes: readonly EpisodeSummary[] }) {
  const { episode, frame, sensor } = problem;
  const position = episodes.findIndex((one) => one.episode_id === episode);
  if (!episode || position < 0) return <>{[episode, sensor].filter(Boolean).join(", ") || "the dataset"}</>;
  const known = frame !== undefined && frame !== null;
  const query = { ...(known ? { k: frame } : {}), ...(sensor ? { sensor } : {}) };
  return (
    <a href={href({ page: "episode", dataset, episode }, query)} title={episode}>
      {[`Episode ${position + 1}`, known ? `frame ${frame}` : null, sensor].filter(Boolean).join(", ")}
    </a>
  );
}
