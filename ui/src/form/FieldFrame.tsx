import { useId, useState, type ReactNode } from "react";
import type { Problem } from "./context";

interface Props {
  id: string;
  title: string;
  unit?: string;
  description: string;
  problems: readonly Problem[];
  /** The label stands beside the control (switches) instead of above. */
  inline?: boolean;
  /** The control is a group of controls: named by the title, not labelled. */
  group?: boolean;
  children: ReactNode;
}

/** Title, unit, help and problems around a control. */
export function FieldFrame({ id, title, unit, description, problems, inline, group, children }: Props) {
  const [open, setOpen] = useState(false);
  const helpId = useId();
  const wrong = problems.length > 0;
  return (
    <div
      className={`field${inline ? " field-inline" : ""}${wrong ? " field-wrong" : ""}`}
      role={group ? "group" : undefined}
      aria-labelledby={group ? `${id}-title` : undefined}
    >
      <div className="field-head">
        {group ? (
          <span id={`${id}-title`} className="field-title">
            {title}
            {unit && <span className="unit"> {unit}</span>}
          </span>
        ) : (
          <label id={`${id}-title`} htmlFor={id} className="field-title">
            {title}
            {unit && <span className="unit"> {unit}</span>}
          </label>
        )}
        {description && (
          <button
            type="button"
            className="help"
            aria-expanded={open}
            aria-controls={helpId}
            aria-label={`About ${title}`}
            title={plain(description)}
            onClick={() => setOpen(!open)}
          >
            ?
          </button>
        )}
      </div>
      {children}
      {open && (
        <p id={helpId} className="field-help">
          {plain(description)}
        </p>
      )}
      {wrong && (
        <p id={`${id}-error`} className="field-error" role="alert">
          {problems.map((problem) => `${problem.message} ${problem.hint}`.trim()).join(" ")}
        </p>
      )}
    </div>
  );
}

/** Descriptions are Markdown for the reference page; here only code marks matter. */
function plain(text: string): string {
  return text.replaceAll("`", "");
}
