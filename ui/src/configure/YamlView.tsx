import { useEffect, useState } from "react";
import { post, sentence } from "../api/client";
import type { ConfigImportResult, ConfigText } from "../api/types";
import { draft, edit } from "../state/draft";
import { pathText, type JsonObject } from "../state/json";
import { useStore } from "../state/store";

const SILENCE_MS = 300;

/** The configuration as the YAML file that it is; what is typed here changes the form. */
export function YamlView() {
  const document = useStore(draft, (now) => now.history.present);
  const [text, setText] = useState("");
  const [typing, setTyping] = useState(false);
  const [error, setError] = useState("");

  useEffect(() => {
    if (typing) return;
    const stop = new AbortController();
    post<ConfigText>("/config/export", { config: document, format: "yaml" }, stop.signal)
      .then((answer) => setText(answer.text))
      .catch((failure: unknown) => {
        if (!stop.signal.aborted) setError(sentence(failure));
      });
    return () => stop.abort();
  }, [document, typing]);

  useEffect(() => {
    if (!typing) return;
    const stop = new AbortController();
    const timer = window.setTimeout(() => {
      post<ConfigImportResult>("/config/import", { text, format: "yaml" }, stop.signal)
        .then((answer) => {
          const errors = answer.errors ?? [];
          setError(errors.map((one) => `${pathText(one.path)}: ${one.message} ${one.hint}`).join("\n"));
          if (errors.length === 0) edit(() => answer.config as JsonObject, "yaml");
        })
        .catch((failure: unknown) => {
          if (!stop.signal.aborted) setError(sentence(failure));
        });
    }, SILENCE_MS);
    return () => {
      stop.abort();
      window.clearTimeout(timer);
    };
  }, [text, typing]);

  return (
    <div className="yaml">
      <textarea
        className="yaml-text"
        aria-label="Configuration as YAML"
        spellCheck={false}
        value={text}
        onFocus={() => setTyping(true)}
        onBlur={() => {
          if (!error) setTyping(false);
        }}
        onChange={(event) => setText(event.target.value)}
      />
      {error && (
        <p className="field-error pre" role="alert">
          {error}
        </p>
      )}
    </div>
  );
}
