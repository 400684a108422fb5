import type { TableFilter } from "../api/types";

interface Props {
  classes: Record<string, number>;
  colours: Record<string, number[]>;
  chosen: TableFilter["value"];
  onChoose(name: string | null): void;
}

/** The colours of the classes, with how many rows each has; a press shows that class alone. */
export function ClassLegend({ classes, colours, chosen, onChoose }: Props) {
  const entries = Object.entries(classes);
  if (entries.length === 0) return null;
  return (
    <div className="class-legend" role="group" aria-label="Classes">
      {entries.map(([name, rows]) => (
        <button key={name} type="button" className="chip" aria-pressed={name === chosen} onClick={() => onChoose(name === chosen ? null : name)}>
          <span className="dot" style={{ "--colour": `rgb(${(colours[name] ?? [128, 128, 128]).join(",")})` } as React.CSSProperties} />
          {name.replaceAll("_", " ")} <span className="muted">{rows.toLocaleString("en")}</span>
        </button>
      ))}
    </div>
  );
}
