import { useEffect, useMemo, useState, type MouseEvent } from "react";
import { post, sentence } from "../api/client";
import type { DatasetDetail, EpisodeSummary, TablePage, TableRequest } from "../api/types";
import { changeQuery, useQuery } from "../app/query";
import { goTo, href } from "../app/routes";
import { ClassLegend } from "./ClassLegend";
import { FilterRow } from "./FilterRow";
import { allowedValues, cellText, heading, TABLES, unitOf } from "./labelColumns";
import { readTable, writeTable, type TableAddress, type TableName } from "./tableAddress";

const PAGE = 50;
type Column = TablePage["columns"][number];

interface Props {
  base: string;
  dataset: string;
  detail: DatasetDetail;
}

/** The label tables, filtered and sorted by the server; a row leads to its frame. */
export function LabelTable({ base, dataset, detail }: Props) {
  const query = useQuery();
  const address = useMemo(() => readTable(query), [query]);
  const { table, episode, filters, sort, all } = address;
  const change = (next: Partial<TableAddress>) => changeQuery(writeTable(next));
  const { page, error } = useTablePage(base, address);
  const shown = columnsOf(page, all ? [] : TABLES[table].usual);
  const numbers = useMemo(
    () => new Map(detail.episodes.map((one) => [one.episode_id, one.number])),
    [detail.episodes],
  );
  const chosen = filters.find((one) => one.column === "class" && one.op === "eq")?.value ?? null;
  return (
    <div className="label-table">
      <div className="table-tools">
        <div className="segments" role="group" aria-label="Table">
          {(Object.keys(TABLES) as TableName[]).map((name) => (
            <button
              key={name}
              type="button"
              className="segment"
              aria-pressed={name === table}
              onClick={() => change({ table: name, filters: [], sort: null })}
            >
              {TABLES[name].title}
            </button>
          ))}
        </div>
        <EpisodeChoice episodes={detail.episodes} episode={episode} onChoose={(next) => change({ episode: next })} />
        <button type="button" className="button small" aria-pressed={all} onClick={() => change({ all: !all, offset: address.offset })}>
          All columns
        </button>
        <span className="spacer" />
        <Pages offset={address.offset} total={page?.total ?? 0} onOffset={(offset) => change({ offset })} />
      </div>
      {page && <FilterRow columns={page.columns} filters={filters} onFilters={(next) => change({ filters: next })} />}
      {page && (
        <ClassLegend
          classes={page.classes ?? {}}
          colours={detail.class_colours}
          chosen={chosen}
          onChoose={(name) =>
            change({
              filters: [
                ...filters.filter((one) => one.column !== "class"),
                ...(name === null ? [] : [{ column: "class", op: "eq" as const, value: name }]),
              ],
            })
          }
        />
      )}
      {error && (
        <p className="field-error" role="alert">
          {error}
        </p>
      )}
      <div className="panel table-scroll tall" tabIndex={0} role="region" aria-label={`Table ${TABLES[table].title}`}>
        <table>
          <thead>
            <tr>
              {shown.map(({ column }) => (
                <Heading key={column.name} column={column} sort={sort} descending={address.descending} onSort={change} />
              ))}
            </tr>
          </thead>
          <tbody>
            {(page?.rows ?? []).map((row, i) => (
              <Row key={address.offset + i} row={row} shown={shown} page={page} dataset={dataset} numbers={numbers} colours={detail.class_colours} />
            ))}
          </tbody>
        </table>
        {page?.rows.length === 0 && <p className="empty">No row fits.</p>}
        {!page && !error && <p className="empty">Reading the labels…</p>}
      </div>
      {page && <Meanings columns={shown.map(({ column }) => column)} />}
    </div>
  );
}

/** Rows as the server has them; none while those of another table come. */
function useTablePage(base: string, address: TableAddress): { page: TablePage | null; error: string } {
  const { table, episode, filters, sort, descending, offset } = address;
  const [answer, setAnswer] = useState<{ table: TableName; page: TablePage } | null>(null);
  const [error, setError] = useState("");
  useEffect(() => {
    const stop = new AbortController();
    const timer = window.setTimeout(() => {
      const request: TableRequest = {
        table,
        episode: episode || null,
        filters: filters.filter((one) => one.value !== "" && one.value !== null),
        sort,
        descending,
        offset,
        limit: PAGE,
      };
      post<TablePage>(`${base}/table`, request, stop.signal).then(
        (page) => {
          setAnswer({ table, page });
          setError("");
        },
        (failure: unknown) => {
          if (!stop.signal.aborted) setError(sentence(failure));
        },
      );
    }, 150);
    return () => {
      stop.abort();
      window.clearTimeout(timer);
    };
  }, [base, table, episode, filters, sort, descending, offset]);
  return { page: answer?.table === table ? answer.page : null, error };
}

interface Shown {
  column: Column;
  index: number;
}

function columnsOf(page: TablePage | null, usual: readonly string[]): Shown[] {
  const known = (page?.columns ?? []).map((column, index) => ({ column, index }));
  if (usual.length === 0) return known;
  return usual.flatMap((name) => known.find(({ column }) => column.name === name) ?? []);
}

interface HeadingProps {
  column: Column;
  sort: string | null;
  descending: boolean;
  onSort(change: Partial<TableAddress>): void;
}

function Heading({ column, sort, descending, onSort }: HeadingProps) {
  const here = sort === column.name;
  const values = allowedValues(column.unit);
  return (
    <th aria-sort={here ? (descending ? "descending" : "ascending") : undefined}>
      <button
        type="button"
        className="link"
        title={`${column.name}: ${column.meaning}${values ? ` (${values})` : ""}`}
        onClick={() => onSort({ sort: column.name, descending: here ? !descending : false })}
      >
        {heading(column.name)}
        {unitOf(column.unit) && <span className="unit"> {unitOf(column.unit)}</span>}
        {here ? (descending ? " ↓" : " ↑") : ""}
      </button>
    </th>
  );
}

interface RowProps {
  row: TablePage["rows"][number];
  shown: readonly Shown[];
  page: TablePage | null;
  dataset: string;
  numbers: ReadonlyMap<string, number>;
  colours: Record<string, number[]>;
}

function Row({ row, shown, page, dataset, numbers, colours }: RowProps) {
  const value = (name: string) => row[page?.columns.findIndex((column) => column.name === name) ?? -1];
  const [id, k, track, sensor] = [value("episode_id"), value("k"), value("track_id"), value("sensor_id")];
  const opens = typeof id === "string" && typeof k === "number";
  const query = { k: Number(k), ...(typeof track === "number" ? { track } : {}), ...(sensor ? { sensor: String(sensor) } : {}) };
  const route = { page: "episode", dataset, episode: String(id) } as const;
  const open = (event: MouseEvent) => {
    // A text that was marked in the row is to be copied, and a link has its own click.
    if ((event.target as HTMLElement).closest("a") || window.getSelection()?.toString()) return;
    goTo(route, query);
  };
  return (
    <tr className={opens ? "opens" : undefined} onClick={opens ? open : undefined}>
      {shown.map(({ column, index }) => {
        const cell = row[index];
        const { text, full } = cellText(column.name, unitOf(column.unit), cell);
        const number = typeof cell === "number" && !["episode_id", "track_id"].includes(column.name);
        return (
          <td key={column.name} className={number ? "number" : undefined} title={column.name === "episode_id" ? String(cell) : full}>
            {column.name === "k" && opens ? (
              <a href={href(route, query)} aria-label={`frame ${text}, open it`}>
                {text}
              </a>
            ) : column.name === "episode_id" ? (
              `Episode ${numbers.get(String(cell)) ?? String(cell)}`
            ) : column.name === "class" && colours[String(cell)] ? (
              <span className="class-name">
                <span className="dot" style={{ "--colour": `rgb(${colours[String(cell)]?.join(",")})` } as React.CSSProperties} />
                {text}
              </span>
            ) : (
              text
            )}
          </td>
        );
      })}
    </tr>
  );
}

/** What the columns mean: the words of the dataset's own schema. */
function Meanings({ columns }: { columns: readonly Column[] }) {
  return (
    <details className="panel meanings">
      <summary>What the columns mean</summary>
      <dl>
        {columns
          .filter((column) => column.meaning)
          .map((column) => (
            <div key={column.name}>
              <dt>
                {heading(column.name)} <span className="muted mono">{column.name}</span>
              </dt>
              <dd>
                {column.meaning}
                {column.unit && column.unit !== "-" && <span className="muted"> ({column.unit})</span>}
              </dd>
            </div>
          ))}
      </dl>
    </details>
  );
}

function EpisodeChoice({ episodes, episode, onChoose }: { episodes: readonly EpisodeSummary[]; episode: string; onChoose(id: string): void }) {
  return (
    <select className="input compact" aria-label="Episode" value={episode} onChange={(event) => onChoose(event.target.value)}>
      <option value="">all episodes</option>
      {episodes.map((one) => (
        <option key={one.episode_id} value={one.episode_id}>
          episode {one.number}
        </option>
      ))}
    </select>
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
