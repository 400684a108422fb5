import { useEffect, useLayoutEffect, useRef, useState, type KeyboardEvent, type ReactNode } from "react";

const MARGIN_PX = 4;

/** A button that opens a list of commands; arrow keys move in it, Escape closes it. */
export function Menu({ label, name, children }: { label: string; name: string; children: ReactNode }) {
  const [open, setOpen] = useState(false);
  const root = useRef<HTMLDivElement>(null);
  const list = useRef<HTMLDivElement>(null);
  useLayoutEffect(() => {
    if (open && root.current && list.current) placeBelow(list.current, root.current);
  }, [open]);
  useEffect(() => {
    if (!open) return;
    root.current?.querySelector<HTMLElement>("[role=menuitem]")?.focus();
    const away = (event: PointerEvent) => {
      if (!root.current?.contains(event.target as Node)) setOpen(false);
    };
    const moved = () => setOpen(false);
    document.addEventListener("pointerdown", away);
    document.addEventListener("scroll", moved, true);
    window.addEventListener("resize", moved);
    return () => {
      document.removeEventListener("pointerdown", away);
      document.removeEventListener("scroll", moved, true);
      window.removeEventListener("resize", moved);
    };
  }, [open]);
  const keys = (event: KeyboardEvent) => {
    if (!open) return;
    const items = [...(root.current?.querySelectorAll<HTMLElement>("[role=menuitem]") ?? [])];
    const here = items.indexOf(document.activeElement as HTMLElement);
    if (event.key === "Escape") {
      setOpen(false);
      root.current?.querySelector<HTMLElement>("[aria-haspopup]")?.focus();
    } else if (event.key === "ArrowDown") items[(here + 1) % items.length]?.focus();
    else if (event.key === "ArrowUp") items[(here - 1 + items.length) % items.length]?.focus();
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  return (
    <div className="menu" ref={root} onKeyDown={keys}>
      <button
        type="button"
        className="button small"
        aria-haspopup="menu"
        aria-expanded={open}
        aria-label={`${label}: ${name}`}
        onClick={() => setOpen(!open)}
      >
        {label} <span aria-hidden="true">▾</span>
      </button>
      {open && (
        <div className="menu-list" ref={list} role="menu" aria-label={name} onClick={() => setOpen(false)}>
          {children}
        </div>
      )}
    </div>
  );
}

/** Puts a list below its button, right edges in line, but inside the window: panels clip, it must not be. */
function placeBelow(list: HTMLElement, button: HTMLElement) {
  const beside = button.getBoundingClientRect();
  const { width, height } = list.getBoundingClientRect();
  const right = window.innerWidth - MARGIN_PX - width;
  const below = window.innerHeight - MARGIN_PX - height;
  list.style.left = `${Math.max(MARGIN_PX, Math.min(beside.right - width, right))}px`;
  list.style.top = `${Math.max(MARGIN_PX, Math.min(beside.bottom + MARGIN_PX, below))}px`;
}
