import { useEffect, useState } from "react";
import { Dialog } from "../ui/Dialog";

const KEYS: readonly (readonly [string, readonly (readonly [string, string])[]])[] = [
  ["Everywhere", [["?", "This list"], ["↑ ↓", "The next entry of a list or a menu"], ["Esc", "Close what is open"]]],
  ["Configure", [
    ["Ctrl-Z, Ctrl-Shift-Z", "Undo, redo"], ["Arrow keys", "Move the chosen sensors by 5 cm, with Shift by 1 cm"],
    ["[ ]", "Turn them"], ["W, E", "Move, rotate in 3D"], ["Ctrl-D", "Duplicate"], ["Del", "Delete"],
  ]],
  ["Map", [
    ["Arrow keys", "The next spawn point"], ["Enter", "Take it as the start, or for the route"],
    ["+ −, 0", "Closer, farther, all of it"], ["← →", "Move a change of the weather by 0.1 s, with Shift by 1 s"],
  ]],
  ["Episode", [["Space", "Play, pause"], ["← →", "One frame back, on"], ["Home, End", "First, last frame"]]],
];

/** The list of shortcuts, by `?` or by its button. */
export function Shortcuts() {
  const [open, setOpen] = useState(false);
  useEffect(() => {
    const key = (event: KeyboardEvent) => {
      const typing = event.target instanceof HTMLElement && event.target.closest("input, textarea, select");
      if (event.key !== "?" || typing || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      setOpen(true);
    };
    window.addEventListener("keydown", key);
    return () => window.removeEventListener("keydown", key);
  }, []);
  return (
    <>
      <button type="button" className="icon-button" aria-label="Keyboard shortcuts" title="Keyboard shortcuts (?)" onClick={() => setOpen(true)}>
        ?
      </button>
      {open && (
        <Dialog title="Keyboard shortcuts" onClose={() => setOpen(false)}>
          <div className="shortcuts">
            {KEYS.map(([where, keys]) => (
              <section key={where}>
                <h3>{where}</h3>
                <dl>
                  {keys.map(([key, does]) => (
                    <div key={key}>
                      <dt>
                        <kbd>{key}</kbd>
                      </dt>
                      <dd>{does}</dd>
                    </div>
                  ))}
                </dl>
              </section>
            ))}
          </div>
        </Dialog>
      )}
    </>
  );
}

/** Up, Down, Home and End go through the links of a list. */
export function listKeys(event: React.KeyboardEvent<HTMLElement>): void {
  const rows = [...event.currentTarget.querySelectorAll<HTMLElement>("a, button.sensor-row")];
  const here = rows.indexOf(document.activeElement as HTMLElement);
  const to = { ArrowDown: here + 1, ArrowUp: here - 1, Home: 0, End: rows.length - 1 }[event.key];
  if (here < 0 || to === undefined) return;
  event.preventDefault();
  event.stopPropagation();
  rows[Math.min(Math.max(to, 0), rows.length - 1)]?.focus();
}
