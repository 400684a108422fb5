import { useState } from "react";
import { Icon } from "./Icon";

/** A button that copies a text; where the browser lets no page do that, the text is chosen instead. */
export function CopyText({ text, name }: { text: string; name: string }) {
  const [state, setState] = useState<"" | "copied" | "by hand">("");
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(text);
      setState("copied");
    } catch {
      setState("by hand"); // no clipboard on plain HTTP from elsewhere
    }
  };
  return (
    <>
      <button type="button" className="icon-button" aria-label={`Copy ${name}`} title={`Copy ${name}`} onClick={() => void copy()}>
        <Icon name={state === "copied" ? "check" : "copy"} />
      </button>
      <span className="muted" role="status">
        {state === "by hand" ? "Choose the text and copy it." : state}
      </span>
    </>
  );
}

/** Where something is, to be read whole and copied. */
export function Place({ location, name }: { location: string; name: string }) {
  return (
    <span className="place">
      <code title={location}>{location}</code>
      <CopyText text={location} name={name} />
    </span>
  );
}
