import { useState } from "react";
import { patch, remove } from "../api/client";
import type { Command, DatasetSummary, Removed } from "../api/types";
import { goTo } from "../app/routes";
import { CommandDialog } from "../ui/CommandDialog";
import { Place } from "../ui/CopyText";
import { AskDialog, Dialog } from "../ui/Dialog";
import { bytes, count } from "../ui/format";
import { Icon } from "../ui/Icon";
import { Menu } from "../ui/Menu";

/** Where a dataset is, and what can be done with it as a whole. */
export function DatasetActions({ summary }: { summary: DatasetSummary }) {
  const [asked, setAsked] = useState<"rename" | "delete" | Command | null>(null);
  const [left, setLeft] = useState<readonly string[]>([]);
  const close = () => setAsked(null);
  const base = `/datasets/${encodeURIComponent(summary.dataset)}`;
  const { dataset } = summary;
  const item = (name: string, icon: string, choose: () => void) => (
    <button type="button" role="menuitem" onClick={choose}>
      <Icon name={icon} /> {name}
    </button>
  );
  return (
    <>
      <span className="spacer" />
      <Menu label="Actions" name="dataset">
        <a role="menuitem" href={`api${base}/files.zip`} download>
          <Icon name="download" /> Download ({bytes(summary.bytes)})
        </a>
        {item("Rename…", "undo", () => setAsked("rename"))}
        {item("Validate as command", "copy", () => setAsked({ do: "validate", dataset }))}
        {item("Report as command", "copy", () => setAsked({ do: "report", dataset }))}
        {item("Rename as command", "copy", () => setAsked({ do: "rename-dataset", dataset, name: summary.name }))}
        {item("Delete as command", "copy", () => setAsked({ do: "delete-dataset", dataset }))}
        {item("Delete…", "trash", () => setAsked("delete"))}
      </Menu>
      <p className="run-place">
        <Place location={summary.location ?? ""} name="the dataset's place" />
      </p>
      {left.length > 0 && <p role="status">What was not ours stays: {left.join(", ")}.</p>}
      {asked === "rename" && (
        <AskDialog
          title="Rename the dataset"
          label="Name"
          value={summary.name}
          action="Rename"
          note={<p className="muted">Its folder keeps its name, so that paths stay right.</p>}
          onDo={async (name) => void (await patch(base, { name }))}
          onClose={close}
        />
      )}
      {asked === "delete" && (
        <Dialog
          title={`Delete the dataset ${summary.name}?`}
          action="Delete"
          danger
          onDo={async () => {
            const answer = await remove<Removed>(base);
            setLeft(answer?.left ?? []);
            goTo({ page: "datasets", dataset: null });
          }}
          onClose={close}
        >
          <p>
            {count(summary.episodes ?? 0, "episode")}, {count(summary.frames ?? 0, "frame")}, {bytes(summary.bytes)} and
            the logs of its runs go for good:
          </p>
          <p>
            <code>{summary.location}</code>
          </p>
        </Dialog>
      )}
      {asked !== null && typeof asked === "object" && <CommandDialog command={asked} onClose={close} />}
    </>
  );
}
