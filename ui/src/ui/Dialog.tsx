import { useEffect, useId, useRef, useState, type ReactNode } from "react";
import { sentence } from "../api/client";

interface Props {
  title: string;
  children?: ReactNode;
  /** What the button that does it says; without it there is only one that closes. */
  action?: string;
  danger?: boolean;
  disabled?: boolean;
  onDo?(): Promise<void>;
  onClose(): void;
}

/** A question before the page; Escape closes it, the focus returns to where it was. */
export function Dialog({ title, children, action, danger, disabled, onDo, onClose }: Props) {
  const dialog = useRef<HTMLDialogElement>(null);
  const heading = useId();
  const [busy, setBusy] = useState(false);
  const [error, setError] = useState("");
  useEffect(() => {
    const element = dialog.current;
    if (element && !element.open) element.showModal();
  }, []);
  const run = async () => {
    setBusy(true);
    setError("");
    try {
      await onDo?.();
      dialog.current?.close();
    } catch (failure) {
      setError(sentence(failure));
      setBusy(false);
    }
  };
  return (
    <dialog ref={dialog} className="dialog panel" aria-labelledby={heading} onClose={onClose}>
      <form
        onSubmit={(event) => {
          event.preventDefault();
          if (action && !disabled && !busy) void run();
        }}
      >
        <h2 id={heading}>{title}</h2>
        {children}
        {error && (
          <p className="field-error" role="alert">
            {error}
          </p>
        )}
        <div className="dialog-buttons">
          <button type="button" className="button" onClick={() => dialog.current?.close()}>
            {action ? "Cancel" : "Close"}
          </button>
          {action && (
            <button type="submit" className={`button ${danger ? "danger" : "primary"}`} disabled={disabled || busy}>
              {action}
            </button>
          )}
        </div>
      </form>
    </dialog>
  );
}

/** A dialog that asks for one line of text. */
export function AskDialog({
  title,
  label,
  value,
  action,
  note,
  onDo,
  onClose,
}: {
  title: string;
  label: string;
  value: string;
  action: string;
  note?: ReactNode;
  onDo(text: string): Promise<void>;
  onClose(): void;
}) {
  const [text, setText] = useState(value);
  const id = useId();
  return (
    <Dialog title={title} action={action} disabled={text.trim() === ""} onDo={() => onDo(text.trim())} onClose={onClose}>
      <label className="field-title" htmlFor={id}>
        {label}
      </label>
      <input id={id} className="input" value={text} spellCheck={false} autoFocus onChange={(event) => setText(event.target.value)} />
      {note}
    </Dialog>
  );
}
