import { createStore, useStore } from "../state/store";

export type Theme = "light" | "dark";
const KEY = "carstage.theme";

function initial(): Theme {
  const kept = window.localStorage.getItem(KEY);
  if (kept === "light" || kept === "dark") return kept;
  return window.matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark";
}

const theme = createStore<Theme>("dark");

export function applyTheme(next: Theme = initial()): void {
  theme.set(next);
  document.documentElement.dataset.theme = next;
}

export function useTheme(): [Theme, () => void] {
  const now = useStore(theme, (value) => value);
  const toggle = () => {
    const next = now === "dark" ? "light" : "dark";
    window.localStorage.setItem(KEY, next);
    applyTheme(next);
  };
  return [now, toggle];
}
