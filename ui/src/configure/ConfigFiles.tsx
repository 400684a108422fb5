import { useRef, useState } from "react";
import { post, sentence } from "../api/client";
import type { ConfigImportResult, ConfigText, SchemaMessage } from "../api/types";
import { draft, edit } from "../state/draft";
import { pathText, type JsonObject } from "../state/json";
import { saveText } from "../ui/files";
import { Icon } from "../ui/Icon";
import { Menu } from "../ui/Menu";

interface Props {
  schema: SchemaMessage;
  text: boolean;
  onText(): void;
}

/** The configuration in from a file, out to one, as text, or from the beginning. */
export function ConfigFiles({ schema, text, onText }: Props) {
  const file = useRef<HTMLInputElement>(null);
  const [note, setNote] = useState("");
  const attempt = (work: Promise<void>) => {
    setNote("");
    void work.catch((error: unknown) => setNote(sentence(error)));
  };
  const write = async () => {
    const config = draft.get().history.present;
    const answer = await post<ConfigText>("/config/export", { config, format: "yaml" });
    saveText(answer.file_name, answer.text, "application/yaml");
  };
  const read = async (chosen: File) => {
    const body = { text: await chosen.text(), format: "yaml" };
    const answer = await post<ConfigImportResult>("/config/import", body);
    const errors = answer.errors ?? [];
    edit(() => answer.config as JsonObject);
    if (errors.length > 0)
      setNote(errors.map((one) => `${pathText(one.path)}: ${one.message}`).slice(0, 3).join(" "));
  };
  return (
    <>
      <button type="button" className="button small" aria-pressed={text} onClick={onText}>
        YAML
      </button>
      <Menu label="File" name="configuration">
        <button type="button" role="menuitem" onClick={() => file.current?.click()}>
          <Icon name="upload" /> Import YAML
        </button>
        <button type="button" role="menuitem" onClick={() => attempt(write())}>
          <Icon name="download" /> Export YAML
        </button>
        <button type="button" role="menuitem" onClick={() => edit(() => schema.demo as JsonObject)}>
          <Icon name="play" /> Load the demonstration
        </button>
        <button type="button" role="menuitem" onClick={() => edit(() => schema.defaults as JsonObject)}>
          <Icon name="undo" /> Back to the defaults
        </button>
      </Menu>
      <input
        ref={file}
        type="file"
        accept=".yaml,.yml"
        hidden
        aria-label="Configuration file"
        onChange={(event) => {
          const [chosen] = event.target.files ?? [];
          event.target.value = "";
          if (chosen) attempt(read(chosen));
        }}
      />
      {note && (
        <p className="toast toast-bad" role="alert">
          {note}
        </p>
      )}
    </>
  );
}
