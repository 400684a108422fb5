import { useEffect, useRef, useState } from "react";

interface Props {
  id: string;
  value: number | undefined;
  placeholder?: string;
  label?: string;
  whole?: boolean;
  minimum?: number;
  maximum?: number;
  step?: number;
  wrong?: boolean;
  describedBy?: string;
  onChange(value: number | undefined | string): void;
  onDone?(): void;
}

/**
 * A number as one types it. Text that is no number is passed on as text, so that the check names
 * the field; arrow keys step, with Shift ten times as far.
 */
export function NumberInput(props: Props) {
  const { id, value, onChange } = props;
  const shown = value === undefined ? "" : String(rounded(value));
  const [text, setText] = useState(shown);
  const typing = useRef(false);
  useEffect(() => {
    // While one types, "1." stays as it is; what changes otherwise (undo, a drag) is shown at once.
    setText((now) => (typing.current && (value === undefined || Number(now.replace(",", ".")) === value) ? now : shown));
  }, [shown, value]);

  const take = (next: string) => {
    setText(next);
    const trimmed = next.trim().replace(",", ".");
    if (trimmed === "") onChange(undefined);
    else onChange(Number.isFinite(Number(trimmed)) ? Number(trimmed) : next);
  };
  const step = (direction: number, far: boolean) => {
    const size = (props.step ?? (props.whole ? 1 : 0.1)) * (far ? 10 : 1);
    const bound = Math.min(
      Math.max(rounded((value ?? 0) + direction * size), props.minimum ?? -Infinity),
      props.maximum ?? Infinity,
    );
    setText(String(bound));
    onChange(bound);
  };
  return (
    <input
      id={id}
      className="input number"
      type="text"
      inputMode={props.whole ? "numeric" : "decimal"}
      autoComplete="off"
      value={text}
      placeholder={props.placeholder}
      aria-label={props.label}
      aria-invalid={props.wrong || undefined}
      aria-describedby={props.describedBy}
      onFocus={() => (typing.current = true)}
      onBlur={() => {
        typing.current = false;
        setText(shown);
        props.onDone?.();
      }}
      onChange={(event) => take(event.target.value)}
      onKeyDown={(event) => {
        if (event.key === "ArrowUp" || event.key === "ArrowDown") {
          event.preventDefault();
          step(event.key === "ArrowUp" ? 1 : -1, event.shiftKey);
        } else if (event.key === "Enter") event.currentTarget.blur();
      }}
    />
  );
}

function rounded(value: number): number {
  return Math.round(value * 1e6) / 1e6;
}
