import { useState } from "react";
import { goTo } from "../app/routes";
import { live } from "../api/live";
import { ApiError, post, sentence } from "../api/client";
import { useAnswer } from "../api/useAnswer";
import type { DatasetList, DatasetSummary, Estimate, RunStart, RunSummary } from "../api/types";
import { draft, problemsOf, settled, standing } from "../state/draft";
import { pathText, type JsonObject } from "../state/json";
import { useStore } from "../state/store";
import { CommandButton } from "../ui/CommandDialog";
import { bytes, count, duration } from "../ui/format";
import { Icon } from "../ui/Icon";
import { ProblemList } from "./ProblemList";

const STORE = /^(s3a?|gs|gcs|az|azure):\/\//;

/** What a run is given besides the configuration. */
interface Given {
  workers: string;
  catalog: string;
  work: string;
}

/** What the run will cost, and the button that begins it. */
export function StartBar() {
  const now = useStore(draft, (value) => value);
  const { warnings, history, estimate } = now;
  const problems = problemsOf(now);
  const saved = standing(now);
  const { runs, datasetsVersion } = useStore(live, (value) => value);
  const list = useAnswer<DatasetList>("/datasets", datasetsVersion);
  const [error, setError] = useState("");
  const [asked, setAsked] = useState<"" | "present" | "others">("");
  const [busy, setBusy] = useState(false);
  const [folder, setFolder] = useState<string | null>(null);
  const [given, setGiven] = useState<Given>({ workers: "1", catalog: "", work: "" });
  const dataset = folder ?? suggestedName(history.present);
  const ahead = runs.filter((run) => run.alive === "running" || run.alive === "queued").length;
  const present = presentAt(list.data, dataset);
  const elsewhere = STORE.test(dataset) || STORE.test(list.data?.root ?? "");
  const fits = !estimate || (elsewhere ? estimate.fits_elsewhere : estimate.fits) || (present?.episodes ?? 0) > 0;
  const wanted: RunStart = {
    dataset,
    retries: 2,
    append: false,
    workers: given.workers === "auto" ? "auto" : Number(given.workers) || 1,
    catalog: given.catalog.trim() || null,
    work: given.work.trim() || null,
  };

  const start = async (agreed: "" | "present" | "others" = "") => {
    if (agreed === "" && (present?.episodes ?? 0) > 0) return setAsked("present");
    setBusy(true);
    setError("");
    setAsked("");
    try {
      const rev = await settled();
      const run = await post<RunSummary>("/runs", { ...wanted, rev, append: agreed === "others" });
      goTo({ page: "run", run: run.run_id });
    } catch (failure) {
      setError(failure instanceof ApiError ? failure.message : sentence(failure));
      if (failure instanceof ApiError && failure.answer.code === "other_settings") setAsked("others");
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
          <Costs estimate={estimate} elsewhere={elsewhere} fits={fits} />
        ) : (
          <span className="muted">checking…</span>
        )}
        {saved === "offline" && <span className="bad">not saved: the server does not answer</span>}
      </div>
      {wrong && <ProblemList problems={problems} />}
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
            aria-describedby="dataset-note"
            onChange={(event) => {
              setFolder(event.target.value || null);
              setAsked("");
              setError("");
            }}
          />
        </label>
        <button
          type="button"
          className="button primary start"
          disabled={wrong || busy || saved === "wrong" || !fits}
          onClick={() => void start()}
        >
          <Icon name="play" /> {ahead > 0 ? "Queue" : "Start"}
        </button>
      </div>
      <p id="dataset-note" className="muted start-note" title={`Names are folders in ${list.data?.root ?? "the first place of datasets"}`}>
        {present
          ? `There already: ${count(present.episodes ?? 0, "episode")}, ${count(present.frames ?? 0, "frame")}, ${bytes(present.bytes)}.`
          : elsewhere
            ? "A new dataset in an object store."
            : "A new dataset. Or an address: s3://BUCKET/NAME."}
      </p>
      <details className="where">
        <summary>Workers, catalog, command</summary>
        <Where given={given} onChange={setGiven} />
        <CommandButton command={{ do: "start", run: { ...wanted, config: history.present } }} />
      </details>
      {error && (
        <p className="field-error" role="alert">
          {error}
        </p>
      )}
      {asked === "present" && present && (
        <div className="ask" role="alert">
          <p>
            {present.name} holds {count(present.episodes ?? 0, "episode")} already. Episodes of the same settings are
            skipped, others are added.
          </p>
          <button type="button" className="button small primary" disabled={busy} onClick={() => void start("present")}>
            Record into it
          </button>
          <button type="button" className="button small" onClick={() => setAsked("")}>
            Cancel
          </button>
        </div>
      )}
      {asked === "others" && (
        <div className="button-row">
          <button type="button" className="button small" disabled={busy} onClick={() => void start("others")}>
            Record all the same
          </button>
        </div>
      )}
    </footer>
  );
}

function Costs({ estimate, elsewhere, fits }: { estimate: Estimate; elsewhere: boolean; fits: boolean }) {
  const need = elsewhere ? estimate.work_bytes : estimate.peak_bytes;
  return (
    <>
      <span>
        <b>{count(estimate.frames, "frame")}</b> in {count(estimate.episodes, "episode")}
      </span>
      <span>
        dataset <b>{bytes(estimate.dataset_bytes)}</b>
      </span>
      <span className={fits ? "" : "bad"} title="With the raw recordings that are on the disk at the same time">
        needs <b>{bytes(need)}</b> of {bytes(estimate.disk_free_bytes)} free
        {!fits && ": too little space; record less, or free some"}
      </span>
      <span>
        about <b>{duration(estimate.duration_s)}</b>
      </span>
    </>
  );
}

function Where({ given, onChange }: { given: Given; onChange(next: Given): void }) {
  const field = (key: keyof Given, title: string, placeholder: string, help: string) => (
    <label className="where-field">
      <span className="field-title">{title}</span>
      <input
        className="input"
        value={given[key]}
        placeholder={placeholder}
        spellCheck={false}
        onChange={(event) => onChange({ ...given, [key]: event.target.value })}
      />
      <span className="muted">{help}</span>
    </label>
  );
  return (
    <div className="where-fields">
      {field("workers", "Workers", "1", "Servers on this machine, each recording an episode: a number, or auto.")}
      {field("catalog", "Catalog", "none", "postgresql://… without a password (PGPASSWORD has it), or a file.")}
      {field("work", "Work folder", "the dataset's own", "Folder of this machine for raw recordings and logs.")}
    </div>
  );
}

function suggestedName(document: JsonObject): string {
  const named = typeof document.name === "string" ? document.name : "quickstart";
  return named.trim().replace(/[^A-Za-z0-9_.-]+/g, "-").replace(/^[^A-Za-z0-9]+/, "") || "dataset";
}

/** The dataset that is at a place already. */
function presentAt(list: DatasetList | null, dataset: string): DatasetSummary | undefined {
  const address = STORE.test(dataset) ? dataset.replace(/\/+$/, "") : `${list?.root ?? ""}/${dataset}`;
  return list?.datasets.find((one) => one.location === address);
}
