import { useState } from "react";
import { live } from "../api/live";
import { patch, remove } from "../api/client";
import { useAnswer } from "../api/useAnswer";
import type { Command, ExportEntry, ExportList } from "../api/types";
import { useStore } from "../state/store";
import { CommandDialog } from "../ui/CommandDialog";
import { Place } from "../ui/CopyText";
import { AskDialog, Dialog } from "../ui/Dialog";
import { bytes, count, day } from "../ui/format";
import { Icon } from "../ui/Icon";
import { Menu } from "../ui/Menu";

/** All exports that are there: where, how large; to be downloaded, renamed, deleted. */
export function ExportsList() {
  const jobs = useStore(live, (now) => now.jobs);
  const [version, setVersion] = useState(0);
  const ended = jobs.filter((job) => job.kind === "export" && job.state !== "running").length;
  const list = useAnswer<ExportList>("/exports", `${ended} ${version}`);
  const exports = list.data?.exports ?? [];
  if (list.error)
    return (
      <p className="field-error" role="alert">
        {list.error}
      </p>
    );
  if (exports.length === 0) return null;
  return (
    <section aria-label="Exports that are there">
      <h2 className="small-title">All exports</h2>
      <ul className="exports">
        {exports.map((one) => (
          <ExportRow key={one.name} entry={one} onChange={() => setVersion(version + 1)} />
        ))}
      </ul>
    </section>
  );
}

function ExportRow({ entry, onChange }: { entry: ExportEntry; onChange(): void }) {
  const [asked, setAsked] = useState<"rename" | "delete" | Command | null>(null);
  const close = () => setAsked(null);
  const base = `/exports/${encodeURIComponent(entry.name)}`;
  return (
    <li className="export-row">
      <span>
        <b>{entry.name}</b>{" "}
        <span className="muted">
          {entry.format} of {entry.dataset}, {count(entry.frames, "frame")}, {bytes(entry.bytes)}, {day(entry.changed)}
        </span>
      </span>
      <Place location={entry.location} name={`the place of ${entry.name}`} />
      <Menu label="Actions" name={`export ${entry.name}`}>
        <a role="menuitem" href={`api${base}/files.zip`} download>
          <Icon name="download" /> Download ({bytes(entry.bytes)})
        </a>
        <button type="button" role="menuitem" onClick={() => setAsked("rename")}>
          <Icon name="undo" /> Rename…
        </button>
        <button type="button" role="menuitem" onClick={() => setAsked({ do: "delete-export", name: entry.name })}>
          <Icon name="copy" /> Delete as command
        </button>
        <button type="button" role="menuitem" onClick={() => setAsked("delete")}>
          <Icon name="trash" /> Delete…
        </button>
      </Menu>
      {asked === "rename" && (
        <AskDialog
          title="Rename the export"
          label="Name of its folder"
          value={entry.name}
          action="Rename"
          onDo={async (name) => {
            await patch(base, { name });
            onChange();
          }}
          onClose={close}
        />
      )}
      {asked === "delete" && (
        <Dialog
          title={`Delete the export ${entry.name}?`}
          action="Delete"
          danger
          onDo={async () => {
            await remove(base);
            onChange();
          }}
          onClose={close}
        >
          <p>
            {bytes(entry.bytes)} go for good; the dataset stays: <code>{entry.location}</code>
          </p>
        </Dialog>
      )}
      {asked !== null && typeof asked === "object" && <CommandDialog command={asked} onClose={close} />}
    </li>
  );
}
