import { useState } from "react";
import { get, patch, post, remove, sentence } from "../api/client";
import type { Command, RunDetail, RunSummary } from "../api/types";
import { live } from "../api/live";
import { goTo } from "../app/routes";
import { edit } from "../state/draft";
import type { JsonObject } from "../state/json";
import { useStore } from "../state/store";
import { CommandDialog } from "../ui/CommandDialog";
import { AskDialog, Dialog } from "../ui/Dialog";
import { Icon } from "../ui/Icon";
import { Menu } from "../ui/Menu";
import { isActive } from "./states";

type Asked = "duplicate" | "rename" | "delete" | Command | null;

/** What can be done with a run: go on, do it once more, name it, take it away. */
export function RunActions({ run, onError }: { run: RunSummary; onError(text: string): void }) {
  const [asked, setAsked] = useState<Asked>(null);
  const [busy, setBusy] = useState(false);
  const close = () => setAsked(null);
  const over = run.alive === "ended" || run.alive === "dead";
  const attempt = (work: Promise<void>) => {
    onError("");
    setBusy(true);
    void work.catch((failure: unknown) => onError(sentence(failure))).finally(() => setBusy(false));
  };
  const again = async (dataset?: string) => {
    const made = await post<RunSummary>(`/runs/${run.run_id}/again`, dataset ? { dataset } : {});
    goTo({ page: "run", run: made.run_id });
  };
  const load = async () => {
    const detail = await get<RunDetail>(`/runs/${run.run_id}`);
    edit(() => detail.config as JsonObject);
    goTo({ page: "configure" });
  };
  // As for Start: whatever goes on or waits comes first.
  const ahead = useStore(live, (now) => now.runs.some((one) => isActive(one) || one.alive === "queued"));
  return (
    <>
      {run.resumable && (
        <button
          type="button"
          className="button primary"
          disabled={busy}
          title="Records what is missing, with the same settings; what is committed stays"
          onClick={() => attempt(again())}
        >
          <Icon name="play" /> {run.state === "interrupted" || run.alive === "dead" ? "Resume" : "Retry"}
        </button>
      )}
      <Menu label="Actions" name="run">
        <button type="button" role="menuitem" onClick={() => setAsked("duplicate")}>
          <Icon name="copy" /> Duplicate…
        </button>
        <button type="button" role="menuitem" onClick={() => attempt(load())}>
          <Icon name="upload" /> Load this configuration
        </button>
        <button type="button" role="menuitem" onClick={() => setAsked("rename")}>
          <Icon name="undo" /> Rename…
        </button>
        {run.folder && (
          <a role="menuitem" href={`api/runs/${run.run_id}/files.zip`} download>
            <Icon name="download" /> Download logs
          </a>
        )}
        {run.resumable && (
          <button type="button" role="menuitem" onClick={() => setAsked({ do: "resume", run_id: run.run_id })}>
            <Icon name="copy" /> Resume as command
          </button>
        )}
        {isActive(run) && (
          <button type="button" role="menuitem" onClick={() => setAsked({ do: "stop", run_id: run.run_id })}>
            <Icon name="copy" /> Stop as command
          </button>
        )}
        {over && run.folder && (
          <button type="button" role="menuitem" onClick={() => setAsked({ do: "delete-run", run_id: run.run_id })}>
            <Icon name="copy" /> Delete as command
          </button>
        )}
        {!isActive(run) && (
          <button type="button" role="menuitem" className="bad" onClick={() => setAsked("delete")}>
            <Icon name="trash" /> Delete…
          </button>
        )}
      </Menu>
      {asked === "duplicate" && (
        <AskDialog
          title={`Record ${run.name} once more`}
          label="Into the dataset"
          value={`${run.dataset.split("~").at(-1) ?? "dataset"}-2`}
          action={ahead ? "Queue" : "Start"}
          note={<p className="muted">The same settings and seeds: the same episodes, in a dataset of their own.</p>}
          onDo={again}
          onClose={close}
        />
      )}
      {asked === "rename" && (
        <AskDialog
          title="Rename the run"
          label="Name"
          value={run.name}
          action="Rename"
          onDo={async (name) => void (await patch(`/runs/${run.run_id}`, { name }))}
          onClose={close}
        />
      )}
      {asked === "delete" && (
        <Dialog
          title={`Delete the run ${run.name}?`}
          action="Delete"
          danger
          onDo={async () => {
            await remove(`/runs/${run.run_id}`);
            goTo({ page: "run", run: null });
          }}
          onClose={close}
        >
          <p>
            Its log, its plan and its raw recordings go. The episodes that it has committed stay in the dataset. This
            cannot be undone.
          </p>
        </Dialog>
      )}
      {asked !== null && typeof asked === "object" && <CommandDialog command={asked} onClose={close} />}
    </>
  );
}
