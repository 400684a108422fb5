import { useRef, useState } from "react";
import { post, sentence } from "../api/client";
import type { ConfigImportResult, ConfigText } from "../api/types";
import { draft, edit } from "../state/draft";
import type { JsonObject } from "../state/json";
import { saveText } from "../ui/files";
import { Icon } from "../ui/Icon";
import { Menu } from "../ui/Menu";

/** CARLA-style sensor lists: in from a file, out to one; calibrations of others in. */
export function SensorLists() {
  const file = useRef<HTMLInputElement>(null);
  const calibration = useRef<HTMLInputElement>(null);
  const [note, setNote] = useState("");
  const [told, setTold] = useState<readonly string[]>([]);
  const write = async () => {
    const config = draft.get().history.present;
    const answer = await post<ConfigText>("/config/export", { config, format: "carla-json" });
    saveText(answer.file_name, answer.text, "application/json");
  };
  const read = async (chosen: readonly File[], format: "carla-json" | "calibration") => {
    const base = draft.get().history.present;
    const text = chosen.length > 1 ? await together(chosen) : ((await chosen[0]?.text()) ?? "");
    const answer = await post<ConfigImportResult>("/config/import", { text, format, base });
    edit(() => answer.config as JsonObject);
    setNote("");
    setTold(answer.warnings ?? []);
  };
  const attempt = (work: Promise<void>) => void work.catch((error: unknown) => setNote(sentence(error)));
  return (
    <>
      <Menu label="JSON" name="CARLA-style sensor list">
        <button type="button" role="menuitem" onClick={() => file.current?.click()}>
          <Icon name="upload" /> Import a sensor list
        </button>
        <button type="button" role="menuitem" onClick={() => calibration.current?.click()}>
          <Icon name="upload" /> Import a calibration (KITTI, nuScenes, ROS)
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
          if (chosen) attempt(read([chosen], "carla-json"));
        }}
      />
      <input
        ref={calibration}
        type="file"
        multiple
        accept=".txt,.json,.yaml,.yml"
        hidden
        aria-label="Calibration files"
        onChange={(event) => {
          const chosen = [...(event.target.files ?? [])];
          event.target.value = "";
          if (chosen.length > 0) attempt(read(chosen, "calibration"));
        }}
      />
      {told.length > 0 && (
        <div className="toast" role="status" aria-label="What the import says">
          <ul>
            {told.map((one) => (
              <li key={one}>{one}</li>
            ))}
          </ul>
          <button type="button" className="button small" onClick={() => setTold([])}>
            Close
          </button>
        </div>
      )}
      {note && (
        <p className="toast toast-bad" role="alert">
          {note}
        </p>
      )}
    </>
  );
}

/** Several files as one text: nuScenes' tables by name, camera_info files one after the other. */
async function together(files: readonly File[]): Promise<string> {
  const texts = await Promise.all(files.map((file) => file.text()));
  if (files.every((file) => file.name.endsWith(".json")))
    return `{${files.map((file, i) => `${JSON.stringify(file.name)}: ${texts[i] ?? "null"}`).join(",")}}`;
  return texts.join("\n---\n");
}
