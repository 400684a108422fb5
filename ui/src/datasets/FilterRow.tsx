import type { TableFilter, TablePage } from "../api/types";
import { Icon } from "../ui/Icon";

const OPS: Record<TableFilter["op"], string> = {
  eq: "=",
  ne: "≠",
  lt: "<",
  le: "≤",
  gt: ">",
  ge: "≥",
  contains: "contains",
};

interface Props {
  columns: TablePage["columns"];
  filters: readonly TableFilter[];
  onFilters(filters: TableFilter[]): void;
}

/** Conditions that rows must fulfil, all of them; the server reads what is typed as the column's type. */
export function FilterRow({ columns, filters, onFilters }: Props) {
  const change = (index: number, part: Partial<TableFilter>) =>
    onFilters(filters.map((filter, i) => (i === index ? { ...filter, ...part } : filter)));
  const first = columns.find((one) => one.name === "distance" || one.name === "distance_ego") ?? columns[0];
  return (
    <div className="filters" role="group" aria-label="Filters">
      {filters.map((filter, index) => (
        <span className="filter" key={index}>
          <select
            className="input compact"
            aria-label={`Column of filter ${index + 1}`}
            value={filter.column}
            onChange={(event) => change(index, { column: event.target.value, value: "" })}
          >
            {columns.map(({ name }) => (
              <option key={name}>{name}</option>
            ))}
          </select>
          <select
            className="input compact"
            aria-label={`Comparison of filter ${index + 1}`}
            value={filter.op}
            onChange={(event) => change(index, { op: event.target.value as TableFilter["op"] })}
          >
            {Object.entries(OPS).map(([op, sign]) => (
              <option key={op} value={op}>
                {sign}
              </option>
            ))}
          </select>
          <input
            className="input compact"
            aria-label={`Value of filter ${index + 1}`}
            value={filter.value === null ? "" : String(filter.value)}
            size={10}
            onChange={({ target }) => change(index, { value: target.value })}
          />
          <button
            type="button"
            className="icon-button"
            aria-label={`Remove filter ${index + 1}`}
            onClick={() => onFilters(filters.filter((_, i) => i !== index))}
          >
            ×
          </button>
        </span>
      ))}
      <button
        type="button"
        className="button small"
        onClick={() => onFilters([...filters, { column: first?.name ?? "k", op: "lt", value: "" }])}
      >
        <Icon name="plus" /> Filter
      </button>
    </div>
  );
}
