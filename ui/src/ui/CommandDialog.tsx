import { useEffect, useState } from "react";
import { post, sentence } from "../api/client";
import type { Command, CommandText } from "../api/types";
import { CopyText } from "./CopyText";
import { Dialog } from "./Dialog";

/** The command that does the same in a terminal of the server's machine. */
export function CommandDialog({ command, onClose }: { command: Command; onClose(): void }) {
  const [text, setText] = useState("");
  const [error, setError] = useState("");
  const asked = JSON.stringify(command);
  useEffect(() => {
    post<CommandText>("/command", { command: JSON.parse(asked) as Command }).then(
      (answer) => setText(answer.text),
      (failure: unknown) => setError(sentence(failure)),
    );
  }, [asked]);
  return (
    <Dialog title="Copy as command" onClose={onClose}>
      <p className="muted">Does the same in a terminal on the machine that serves this page.</p>
      {error ? (
        <p className="field-error" role="alert">
          {error}
        </p>
      ) : (
        <pre className="command" tabIndex={0} aria-label="Command">
          {text || "…"}
        </pre>
      )}
      {text && <CopyText text={text} name="the command" />}
    </Dialog>
  );
}

/** A button that shows the command for what stands beside it. */
export function CommandButton({ command, label = "Copy as command" }: { command: Command; label?: string }) {
  const [open, setOpen] = useState(false);
  return (
    <>
      <button type="button" className="button small" onClick={() => setOpen(true)}>
        {label}
      </button>
      {open && <CommandDialog command={command} onClose={() => setOpen(false)} />}
    </>
  );
}
