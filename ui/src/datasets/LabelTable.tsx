import { useEffect, useState } from "react";
import { post, sentence } from "../api/client";
import type { EpisodeSummary, TableFilter, TablePage, TableRequest } from "../api/types";
import { words } from "../form/simple";
import { FilterRow } from "./FilterRow";

type TableName = NonNullable<TableRequest["table"]>;
const TABLES: Record<TableName, string> = {
  camera_objects: "Objects in cameras",
  objects: "Objects",
  ego: "Ego",
  frames: "Frames",
};
const USUAL: Record<TableName, string[]> = {
  camera_objects: ["episode_id", "k", "sensor_id", "track_id", "distance", "visible", "occluded", "occlusion_ratio", "truncated", "visible_px", "bbox_modal", "alpha"],
  objects: ["episode_id", "k", "track_id", "class_name", "type_id", "distance_ego", "num_lidar_points", "visibility", "velocity"],
  ego: ["episode_id", "k", "timestamp_s", "speed", "throttle", "brake", "steer", "speed_limit_kmh", "location"],
  frames: [],
};
const PAGE = 50;

/** The label tables, filtered and sorted by the server. */
export function LabelTable({ base, episodes }: { base: string; dataset: string; episodes: readonly EpisodeSummary[] }) {
  const [table, setTable] = useState<TableName>("camera_objects");
  const [episode, setEpisode] = useState("");
  const [filters, setFilters] = useState<TableFilter[]>([]);
  const [sort, setSort] = useState<{ column: string; descending: boolean } | null>(null);
  const [offset, setOffset] = useState(0);
  const [all, setAll] = useState(false);
  const [page, setPage] = useState<TablePage | null>(null);
  const [error, setError] = useState("");

  useEffect(() => {
    const stop = new AbortController();
    const timer = window.setTimeout(() => {
      const request: TableRequest = {
        table,
        episode: episode || null,
        filters: filters.filter((one) => one.value !== "" && one.value !== null),
        sort: sort?.column ?? null,
        descending: sort?.descending ?? false,
        offset,
        limit: PAGE,
      };
      post<TablePage>(`${base}/table`, request, stop.signal).then(
        (answer) => {
          setPage(answer);
          setError("");
        },
        (failure: unknown) => {
          if (!stop.signal.aborted) setError(sentence(failure));
        },
      );
    }, 200);
    return () => {
      stop.abort();
      window.clearTimeout(timer);
    };
  }, [base, table, episode, filters, sort, offset]);

  const choose = (name: TableName) => {
    setTable(name);
    setFilters([]);
    setSort(null);
    setOffset(0);
    setPage(null);
  };
  const shown = (page?.columns ?? [])
    .map((column, index) => ({ column, index }))
    .filter(({ column }) => all || USUAL[table].length === 0 || USUAL[table].includes(column.name));
  return (
    <div className="label-table">
      <div className="table-tools">
        <div className="segments" role="group" aria-label="Table">
          {(Object.keys(TABLES) as TableName[]).map((name) => (
            <button key={name} type="button" className="segment" aria-pressed={name === table} onClick={() => choose(name)}>
              {TABLES[name]}
            </button>
          ))}
        </div>
        <select className="input compact" aria-label="Episode" value={episode} onChange={(event) => { setEpisode(event.target.value); setOffset(0); }}>
          <option value="">all episodes</option>
          {episodes.map((one) => (
            <option key={one.episode_id} value={one.episode_id}>
              episode {one.number}
            </option>
          ))}
        </select>
        <button type="button" className="button small" aria-pressed={all} onClick={() => setAll(!all)}>
          All columns
        </button>
        <span className="spacer" />
        <Pages offset={offset} total={page?.total ?? 0} onOffset={setOffset} />
      </div>
      {page && (
        <FilterRow
          columns={page.columns}
          filters={filters}
          onFilters={(next) => {
            setFilters(next);
            setOffset(0);
          }}
        />
      )}
      {error && (
        <p className="field-error" role="alert">
          {error}
        </p>
      )}
      <div className="panel table-scroll tall" tabIndex={0} role="region" aria-label={`Table ${TABLES[table]}`}>
        <table>
          <thead>
            <tr>
              {shown.map(({ column }) => (
                <th key={column.name} aria-sort={sort?.column === column.name ? (sort.descending ? "descending" : "ascending") : undefined}>
                  <button
                    type="button"
                    className="link"
                    title={`${column.meaning} (${column.type}${column.unit && column.unit !== "-" ? `, ${column.unit}` : ""})`}
                    onClick={() => {
                      const again = sort?.column === column.name;
                      setSort({ column: column.name, descending: again ? !sort.descending : false });
                      setOffset(0);
                    }}
                  >
                    {words(column.name)}
                    {sort?.column === column.name ? (sort.descending ? " ↓" : " ↑") : ""}
                  </button>
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {(page?.rows ?? []).map((row, i) => (
              <tr key={offset + i}>
                {shown.map(({ column, index }) => (
                  <td key={column.name} className={typeof row[index] === "number" ? "number" : undefined}>
                    {cell(row[index])}
                  </td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
        {page?.rows.length === 0 && <p className="empty">No row fits.</p>}
      </div>
    </div>
  );
}

function Pages({ offset, total, onOffset }: { offset: number; total: number; onOffset(offset: number): void }) {
  return (
    <div className="button-row">
      <span className="muted">
        {total === 0 ? "no rows" : `${offset + 1}–${Math.min(offset + PAGE, total)} of ${total.toLocaleString("en")}`}
      </span>
      <button type="button" className="button small" disabled={offset === 0} onClick={() => onOffset(Math.max(0, offset - PAGE))}>
        Before
      </button>
      <button type="button" className="button small" disabled={offset + PAGE >= total} onClick={() => onOffset(offset + PAGE)}>
        Next
      </button>
    </div>
  );
}

function cell(value: unknown): string {
  if (value === null || value === undefined) return "–";
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : value.toFixed(3);
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (Array.isArray(value)) return value.map(cell).join(", ");
  const text = typeof value === "object" ? JSON.stringify(value) : String(value);
  return text.length > 60 ? `${text.slice(0, 57)}…` : text;
}
