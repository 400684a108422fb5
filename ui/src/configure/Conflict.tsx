import { draft, resolve } from "../state/draft";
import { useStore } from "../state/store";

/** Somebody else changed the configuration while it was changed here. */
export function Conflict() {
  const saved = useStore(draft, (now) => now.saved);
  if (saved !== "conflict") return null;
  return (
    <div className="banner" role="alert">
      <p>Another page has changed this configuration meanwhile.</p>
      <div className="button-row">
        <button type="button" className="button small" onClick={() => resolve("theirs")}>
          Take theirs
        </button>
        <button type="button" className="button small" onClick={() => resolve("mine")}>
          Keep mine
        </button>
      </div>
    </div>
  );
}
