import type { Problem } from "../form/context";
import { pathText, type Path } from "../state/json";

const MOST = 5;

/** What is wrong, each a link to its field. */
export function ProblemList({ problems }: { problems: readonly Problem[] }) {
  return (
    <ul className="problems" aria-label="Problems">
      {problems.slice(0, MOST).map((problem, at) => (
        <li key={`${at} ${pathText(problem.path)}`}>
          <button type="button" className="link" onClick={() => show(problem.path)}>
            {wordsOf(problem.path)}
          </button>{" "}
          {problem.message}
        </li>
      ))}
      {problems.length > MOST && <li className="muted">and {problems.length - MOST} more</li>}
    </ul>
  );
}

/** The path as the form names it: `ego › blueprint`. */
export function wordsOf(path: Path): string {
  const parts = path.map((part) => (typeof part === "number" ? String(part + 1) : part.replace(/_(deg|m|s)$/, "").replaceAll("_", " ")));
  return parts.join(" › ") || "Configuration";
}

/** Go to the field of a path, or to the nearest that is drawn, and open what it is folded in. */
function show(path: Path): void {
  if (path[0] === "rig" && path[1] === "sensors" && typeof path[2] === "number") {
    const row = document.querySelectorAll<HTMLElement>(".sensor-row.wrong")[0];
    row?.click();
    window.setTimeout(() => focusField(path) || row?.focus(), 50);
    return;
  }
  focusField(path);
}

function focusField(path: Path): boolean {
  for (let length = path.length; length > 0; length -= 1) {
    const field = document.getElementById(`field-${path.slice(0, length).join("-")}`);
    if (!field) continue;
    for (let above = field.closest("details"); above; above = above.parentElement?.closest("details") ?? null) above.open = true;
    field.scrollIntoView({ block: "center" });
    const control = field.matches("input, select, textarea, button") ? field : field.querySelector<HTMLElement>("input, select, button");
    control?.focus();
    return true;
  }
  return false;
}
