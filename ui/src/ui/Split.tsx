import { useRef, useState, type KeyboardEvent, type PointerEvent, type ReactNode } from "react";

interface Props {
  /** Under which the size is remembered, and what the handle is called. */
  name: string;
  label: string;
  /** Side by side, or one below the other. */
  direction: "row" | "column";
  initial: number;
  children: readonly [ReactNode, ReactNode];
}

const [LEAST, MOST, STEP] = [0.2, 0.8, 0.02];
const KEY = "carstage.split.";

/** Two panels with a handle between them; the share of the first is remembered. */
export function Split({ name, label, direction, initial, children }: Props) {
  const frame = useRef<HTMLDivElement>(null);
  const [share, setShare] = useState(() => within(Number(window.localStorage.getItem(KEY + name)) || initial));
  const change = (next: number) => {
    const now = within(next);
    setShare(now);
    window.localStorage.setItem(KEY + name, now.toFixed(3));
  };
  const drag = (event: PointerEvent<HTMLDivElement>) => {
    if (event.type === "pointerdown") event.currentTarget.setPointerCapture(event.pointerId);
    if (event.buttons !== 1 || !frame.current) return;
    const box = frame.current.getBoundingClientRect();
    change(direction === "row" ? (event.clientX - box.left) / box.width : (event.clientY - box.top) / box.height);
  };
  const keys = (event: KeyboardEvent) => {
    const by = { ArrowLeft: -STEP, ArrowUp: -STEP, ArrowRight: STEP, ArrowDown: STEP }[event.key];
    if (by === undefined && event.key !== "Enter") return;
    event.preventDefault();
    change(by === undefined ? initial : share + by);
  };
  return (
    <div ref={frame} className={`split split-${direction}`} style={{ "--share": `${share}fr`, "--rest": `${1 - share}fr` } as React.CSSProperties}>
      <div className="split-part">{children[0]}</div>
      <div
        className="split-handle"
        role="separator"
        tabIndex={0}
        aria-label={label}
        aria-orientation={direction === "row" ? "vertical" : "horizontal"}
        aria-valuenow={Math.round(share * 100)}
        aria-valuemin={LEAST * 100}
        aria-valuemax={MOST * 100}
        title={`${label}: drag, arrow keys, Enter or a double click for the usual size`}
        onPointerDown={drag}
        onPointerMove={drag}
        onDoubleClick={() => change(initial)}
        onKeyDown={keys}
      />
      <div className="split-part">{children[1]}</div>
    </div>
  );
}

function within(share: number): number {
  return Math.min(MOST, Math.max(LEAST, share));
}
