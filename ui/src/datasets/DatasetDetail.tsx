import { useAnswer } from "../api/useAnswer";
import type { CampaignList, DatasetDetail } from "../api/types";
import { changeQuery, useQuery } from "../app/query";
import { bytes, count } from "../ui/format";
import { CampaignView } from "./CampaignView";
import { DatasetActions } from "./DatasetActions";
import { StateBadge } from "./DatasetsPage";
import { EpisodeList } from "./EpisodeList";
import { ExportView } from "./ExportView";
import { LabelTable } from "./LabelTable";
import { ReportView } from "./ReportView";
import { StatisticsView } from "./StatisticsView";
import { ValidationView } from "./ValidationView";

const TABS = ["Episodes", "Campaign", "Statistics", "Labels", "Validation", "Report", "Export"] as const;
type Tab = (typeof TABS)[number];

/** A dataset: its episodes, what it holds, whether it is right, and other formats of it. */
export function DatasetDetailView({ dataset, version }: { dataset: string; version: number }) {
  const base = `/datasets/${encodeURIComponent(dataset)}`;
  const answer = useAnswer<DatasetDetail>(base, version);
  const campaigns = useAnswer<CampaignList>(`${base}/campaigns`, version);
  const found = [...(campaigns.data?.campaigns ?? []), ...(campaigns.data?.problems ?? [])];
  const isCampaign = found.length > 0 || campaigns.error !== null;
  const tabs = TABS.filter((name) => name !== "Campaign" || isCampaign);
  const asked = useQuery().get("tab");
  const tab = tabs.find((name) => name.toLowerCase() === asked) ?? "Episodes";
  const setTab = (name: Tab) => changeQuery({ tab: name === "Episodes" ? null : name.toLowerCase() }, true);
  const detail = answer.data;
  if (!detail)
    return (
      <section className="panel">
        <h1 className="sr-only">Dataset</h1>
        <p className="empty">{answer.error ?? "Loading…"}</p>
      </section>
    );
  const { summary } = detail;
  return (
    <section className="dataset" aria-label={summary.name}>
      <header className="page-head">
        <h1>{summary.name}</h1>
        <StateBadge summary={summary} />
        <span className="muted">
          {count(summary.episodes ?? 0, "episode")}, {count(summary.frames ?? 0, "frame")}, {bytes(summary.bytes)}
        </span>
        <DatasetActions summary={summary} />
      </header>
      {summary.problem && (
        <p className="field-error" role="alert">
          {summary.problem}
        </p>
      )}
      <div className="tabs" role="tablist" aria-label="Dataset">
        {tabs.map((name) => (
          <button
            key={name}
            type="button"
            role="tab"
            id={`tab-${name}`}
            aria-selected={name === tab}
            aria-controls="tab-panel"
            tabIndex={name === tab ? 0 : -1}
            onClick={() => setTab(name)}
            onKeyDown={(event) => {
              const by = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
              const next = tabs[(tabs.indexOf(name) + by + tabs.length) % tabs.length];
              if (by === 0 || !next) return;
              setTab(next);
              document.getElementById(`tab-${next}`)?.focus();
            }}
          >
            {name}
          </button>
        ))}
      </div>
      <div className="tab-panel" id="tab-panel" role="tabpanel" aria-labelledby={`tab-${tab}`} tabIndex={0}>
        {tab === "Episodes" && <EpisodeList dataset={dataset} episodes={detail.episodes} />}
        {tab === "Campaign" && campaigns.data && <CampaignView {...campaigns.data} />}
        {tab === "Campaign" && campaigns.error && <p className="empty">{campaigns.error}</p>}
        {tab === "Statistics" && <StatisticsView base={base} version={version} />}
        {tab === "Labels" && <LabelTable base={base} dataset={dataset} detail={detail} />}
        {tab === "Validation" && <ValidationView base={base} dataset={dataset} episodes={detail.episodes} version={version} />}
        {tab === "Report" && <ReportView base={base} dataset={dataset} version={version} />}
        {tab === "Export" && <ExportView base={base} dataset={dataset} />}
      </div>
    </section>
  );
}
