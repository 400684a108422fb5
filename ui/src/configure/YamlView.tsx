import { useEffect, useState } from "react";
import { post, sentence } from "../api/client";
import type { ConfigText } from "../api/types";
import { draft } from "../state/draft";
import { pathText } from "../state/json";
import { useStore } from "../state/store";
import { showText, typeText } from "../state/typedText";

/** The configuration as the YAML file that it is; what is typed here changes the form. */
export function YamlView() {
  const document = useStore(draft, (now) => now.history.present);
  const typed = useStore(draft, (now) => now.typed);
  const [text, setText] = useState("");
  const [focused, setFocused] = useState(false);
  const [failure, setFailure] = useState("");
  const wrong = typed?.map((one) => `${pathText(one.path)}: ${one.message} ${one.hint}`).join("\n");
  const error = wrong || failure;

  useEffect(() => {
    showText(true);
    return () => showText(false);
  }, []);

  useEffect(() => {
    if (focused || typed !== null) return;
    const stop = new AbortController();
    post<ConfigText>("/config/export", { config: document, format: "yaml" }, stop.signal)
      .then((answer) => {
        setText(answer.text);
        setFailure("");
      })
      .catch((reason: unknown) => {
        if (!stop.signal.aborted) setFailure(sentence(reason));
      });
    return () => stop.abort();
  }, [document, focused, typed]);

  return (
    <div className="yaml">
      <textarea
        className="yaml-text"
        aria-label="Configuration as YAML"
        spellCheck={false}
        value={text}
        onFocus={() => setFocused(true)}
        onBlur={() => setFocused(false)}
        onChange={(event) => {
          setText(event.target.value);
          typeText(event.target.value);
        }}
      />
      {error && (
        <p className="field-error pre" role="alert">
          {error}
        </p>
      )}
    </div>
  );
}
