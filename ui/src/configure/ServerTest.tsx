import { useState } from "react";
import { isEmbedded, keyOf, serverFacts } from "./serverFacts";
import { post, sentence } from "../api/client";
import type { ServerCheck } from "../api/types";
import type { JsonObject } from "../state/json";
import { Icon } from "../ui/Icon";

/** Tries the chosen server: does it answer, which version, which maps. */
export function ServerTest({ document }: { document: JsonObject }) {
  const [verdict, setVerdict] = useState<ServerCheck | null>(null);
  const [busy, setBusy] = useState(false);
  const test = async () => {
    setBusy(true);
    try {
      const check = await post<ServerCheck>("/server/check", { server: document.server ?? { kind: "embedded" } });
      setVerdict(check);
      serverFacts.set({ server: keyOf(document), check });
    } catch (error) {
      setVerdict({ ok: false, message: sentence(error), hint: "", maps: [] });
    } finally {
      setBusy(false);
    }
  };
  return (
    <div className="server-test">
      <button type="button" className="button small" disabled={busy} onClick={() => void test()}>
        {busy ? "Testing…" : "Test the connection"}
      </button>
      {verdict && !busy && (
        <p className={verdict.ok ? "good" : "bad"} role="status">
          <Icon name={verdict.ok ? "check" : "warn"} /> {verdict.message} {verdict.hint}
          {verdict.version ? ` Version ${verdict.version}.` : ""}
          {verdict.maps && verdict.maps.length > 0 ? ` ${verdict.maps.length} maps.` : ""}
        </p>
      )}
      {!isEmbedded(document) && !verdict?.ok && (
        <p className="muted">
          Maps and vehicles are those of your server: type their names, or test the connection to choose from them.
        </p>
      )}
    </div>
  );
}
