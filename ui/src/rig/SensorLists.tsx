import { useRef, useState } from "react";
import { post, sentence } from "../api/client";
import type { ConfigImportResult, ConfigText } from "../api/types";
import { draft, edit } from "../state/draft";
import type { JsonObject } from "../state/json";
import { saveText } from "../ui/files";
import { Icon } from "../ui/Icon";
import { Menu } from "../ui/Menu";

/** CARLA-style sensor lists: in from a file, out to one. */
export function SensorLists() {
  const file = useRef<HTMLInputElement>(null);
  const [note, setNote] = useState("");
  const write = async () => {
    const config = draft.get().history.present;
    const answer = await post<ConfigText>("/config/export", { config, format: "carla-json" });
    saveText(answer.file_name, answer.text, "application/json");
  };
  const read = async (chosen: File) => {
    const base = draft.get().history.present;
    const answer = await post<ConfigImportResult>("/config/import", {
      text: await chosen.text(),
      format: "carla-json",
      base,
    });
    edit(() => answer.config as JsonObject);
    setNote("");
  };
  const attempt = (work: Promise<void>) => void work.catch((error: unknown) => setNote(sentence(error)));
  return (
    <>
      <Menu label="JSON" name="CARLA-style sensor list">
        <button type="button" role="menuitem" onClick={() => file.current?.click()}>
          <Icon name="upload" /> Import a sensor list
        </button>
        <button type="button" role="menuitem" onClick={() => attempt(write())}>
          <Icon name="download" /> Export a sensor list
        </button>
      </Menu>
      <input
        ref={file}
        type="file"
        accept=".json,application/json"
        hidden
        aria-label="Sensor list file"
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
