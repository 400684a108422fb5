/** Line icons of 16 px; decoration only, the control carries the name. */
const PATHS: Record<string, string> = {
  play: "M5 3.5v9l7-4.500z",
  pause: "M5 3v10M11 3v10",
  stop: "M4 4h8v8H4z",
  undo: "M6 4 3 7l3 3M3 7h6.500a3.500 3.500 0 0 1 0 7H7",
  redo: "m10 4 3 3-3 3M13 7H6.500a3.500 3.500 0 0 0 0 7H9",
  copy: "M6 6h7v7H6zM10 6V3H3v7h3",
  trash: "M3 4.500h10M6 4.500V3h4v1.500M4.500 4.500l.7 8.500h5.600l.7-8.500",
  mirror: "M8 2v12M6 5 2 11h4zM10 5l4 6h-4z",
  plus: "M8 3v10M3 8h10",
  fit: "M3 6V3h3M10 3h3v3M13 10v3h-3M6 13H3v-3",
  expand: "M9 3h4v4M13 3 9 7M7 13H3V9M3 13l4-4",
  shrink: "M13 7H9V3M9 7l4-4M3 9h4v4M7 9l-4 4",
  eye: "M1.500 8S4 3.500 8 3.500 14.500 8 14.500 8 12 12.500 8 12.500 1.500 8 1.500 8zM8 6.200a1.800 1.800 0 1 0 0 3.600 1.800 1.800 0 0 0 0-3.600z",
  sun: "M8 5a3 3 0 1 0 0 6 3 3 0 0 0 0-6zM8 1v1.500M8 13.500V15M1 8h1.500M13.500 8H15M3 3l1 1M12 12l1 1M13 3l-1 1M4 12l-1 1",
  moon: "M13 9.500A5.500 5.500 0 0 1 6.500 3a5.500 5.500 0 1 0 6.500 6.500z",
  first: "M4 3v10M12 3.500v9L6 8z",
  back: "M11 3.500v9L5 8zM4 3v10",
  step: "M5 3.500v9L11 8zM12 3v10",
  download: "M8 2v8M5 7l3 3 3-3M3 13h10",
  upload: "M8 10V2M5 5l3-3 3 3M3 13h10",
  check: "m3 8.500 3.500 3.500L13 4.500",
  warn: "M8 2 1.500 13.500h13zM8 6.500v3.500M8 12v.200",
};

export function Icon({ name }: { name: string }) {
  return (
    <svg className="icon" width="16" height="16" viewBox="0 0 16 16" aria-hidden="true" focusable="false">
      <path d={PATHS[name] ?? ""} />
    </svg>
  );
}
