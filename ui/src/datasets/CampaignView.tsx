import type { Campaign, CampaignList } from "../api/types";
import { CommandButton } from "../ui/CommandDialog";
import { count } from "../ui/format";

/** How far the campaigns of a dataset are: what is planned, recorded and missing, by sampled value. */
export function CampaignView({ campaigns, problems = [] }: CampaignList) {
  return (
    <>
      {problems.map((problem) => (
        <p key={problem} className="muted">
          {problem}
        </p>
      ))}
      {campaigns.map((campaign) => (
        <OneCampaign key={campaign.run_id} campaign={campaign} />
      ))}
    </>
  );
}

function OneCampaign({ campaign }: { campaign: Campaign }) {
  const { name, planned, committed, others, combinations, covered, quotas, axes } = campaign;
  const enough = quotas.length > 0 && quotas.every(({ met }) => met);
  const tiles: [string, string][] = [
    ["Planned", planned.toLocaleString("en")],
    ["Recorded", committed.toLocaleString("en")],
    ["Missing", (planned - committed).toLocaleString("en")],
    ["Sampled", campaign.method.replaceAll("_", " ")],
    ...(combinations > 0 ? [["Combinations", `${covered} of ${combinations}`] as [string, string]] : []),
  ];
  return (
    <section className="campaign" aria-label={`Campaign ${name}`}>
      <header className="page-head">
        <h2>Campaign {name}</h2>
        {others > 0 && <span className="muted">{count(others, "episode")} of the dataset of other settings</span>}
        <span className="spacer" />
        <CommandButton command={{ do: "campaign-report", run_id: campaign.run_id }} />
      </header>
      <dl className="tiles">
        {tiles.map(([title, value]) => (
          <div className="tile" key={title}>
            <dt>{title}</dt>
            <dd>{value}</dd>
          </div>
        ))}
      </dl>
      {enough && planned > committed && <p className="muted">All quotas are met: the missing episodes are not needed.</p>}
      <div className="charts">
        {quotas.length > 0 && (
          <Coverage
            title="Quotas"
            of="frames"
            rows={quotas.map((quota) => ({ label: quota.name, planned: quota.wanted, there: quota.frames }))}
          />
        )}
        {axes.map(({ path, title, bins }) => (
          <Coverage
            key={path}
            title={title || path}
            path={path}
            of="episodes"
            rows={bins.map((bin) => ({ label: bin.label, planned: bin.planned, there: bin.episodes }))}
          />
        ))}
      </div>
    </section>
  );
}

interface Row {
  label: string;
  planned: number;
  there: number;
}

function Coverage({ title, path, of, rows }: { title: string; path?: string; of: string; rows: readonly Row[] }) {
  return (
    <figure className="panel chart">
      <figcaption>
        <h3>{title}</h3>
        {path && path !== title && <code className="muted">{path}</code>}
      </figcaption>
      <div className="table-scroll" tabIndex={0} role="region" aria-label={`Coverage of ${title}`}>
        <table className="coverage-table">
          <thead>
            <tr>
              <th scope="col">{of === "frames" ? "Quota" : "Value"}</th>
              <th scope="col" aria-label="Share" />
              <th scope="col" className="number">
                {of === "frames" ? "Frames" : "Episodes"}
              </th>
              <th scope="col" className="number">
                Missing
              </th>
            </tr>
          </thead>
          <tbody>
            {rows.map(({ label, planned, there }) => (
              <tr key={label}>
                <th scope="row">{label}</th>
                <td aria-hidden="true">
                  <span className="bar">
                    <span style={{ width: `${planned > 0 ? Math.min(100, (100 * there) / planned) : 0}%` }} />
                  </span>
                </td>
                <td className="number">
                  {there.toLocaleString("en")} of {planned.toLocaleString("en")}
                </td>
                <td className={there < planned ? "number short" : "number"}>{Math.max(0, planned - there).toLocaleString("en")}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </figure>
  );
}
