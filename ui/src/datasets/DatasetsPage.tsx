import { live } from "../api/live";
import { useAnswer } from "../api/useAnswer";
import type { DatasetList, DatasetSummary } from "../api/types";
import { href } from "../app/routes";
import { listKeys } from "../app/Shortcuts";
import { useStore } from "../state/store";
import { bytes, count, day } from "../ui/format";
import { DatasetDetailView } from "./DatasetDetail";

/** All datasets below the roots, and one of them in detail. */
export default function DatasetsPage({ dataset }: { dataset: string | null }) {
  const version = useStore(live, (now) => now.datasetsVersion);
  const list = useAnswer<DatasetList>("/datasets", version);
  const datasets = list.data?.datasets ?? [];
  const chosen = dataset ?? datasets[0]?.dataset ?? null;
  return (
    <main className="page datasets-page">
      <aside className="panel dataset-list" aria-label="All datasets">
        <header className="panel-head">
          <h2>Datasets</h2>
          <span className="muted">{datasets.length}</span>
          <span className="spacer" />
          <span className="muted">{bytes(list.data?.disk_free_bytes)} free</span>
        </header>
        {[...(list.error ? [list.error] : []), ...(list.data?.problems ?? [])].map((problem) => (
          <p key={problem} className="field-error" role="alert">
            {problem}
          </p>
        ))}
        <ul onKeyDown={listKeys}>
          {datasets.map((one) => (
            <li key={one.dataset}>
              <DatasetRow summary={one} chosen={one.dataset === chosen} />
            </li>
          ))}
        </ul>
        {list.data && (
          <p className="muted root" title={list.data.root}>
            New ones are made in {list.data.root}.
          </p>
        )}
      </aside>
      {chosen ? (
        <DatasetDetailView key={chosen} dataset={chosen} version={version} />
      ) : (
        <section className="panel">
          <h1 className="sr-only">Datasets</h1>
          <p className="empty">
            {list.loading ? "Looking for datasets…" : "There is no dataset yet. "}
            {!list.loading && <a href={href({ page: "configure" })}>Record one.</a>}
          </p>
        </section>
      )}
    </main>
  );
}

function DatasetRow({ summary, chosen }: { summary: DatasetSummary; chosen: boolean }) {
  return (
    <a
      className="run-row"
      href={href({ page: "datasets", dataset: summary.dataset })}
      aria-current={chosen ? "true" : undefined}
    >
      <span className="run-name">{summary.name || summary.path}</span>
      <StateBadge summary={summary} />
      <span className="muted run-when">
        {summary.path} · {count(summary.episodes ?? 0, "episode")} · {bytes(summary.bytes)} · {day(summary.changed)}
      </span>
    </a>
  );
}

export function StateBadge({ summary }: { summary: DatasetSummary }) {
  if (summary.state === "recording") return <span className="badge badge-live">recording</span>;
  if (summary.state === "damaged") return <span className="badge badge-bad">damaged</span>;
  if (summary.state === "empty") return <span className="badge">empty</span>;
  if (summary.validity === "valid") return <span className="badge badge-good">valid</span>;
  if (summary.validity === "invalid") return <span className="badge badge-bad">invalid</span>;
  return <span className="badge">ready</span>;
}
