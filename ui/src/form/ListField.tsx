import { useState } from "react";
import type { Json } from "../state/json";
import { useField, useForm } from "./context";
import { FieldFrame } from "./FieldFrame";
import { words, type ControlProps } from "./simple";

/** A list of names or numbers as chips; known names are chosen, others typed. */
export function ListField({ path, field }: ControlProps) {
  const { value, problems, id, set } = useField(path, false);
  const { suggestions } = useForm();
  const given = value === undefined ? field.node.default : value;
  const list: Json[] = Array.isArray(given) ? given : [];
  const fixed = field.item?.options?.map(String);
  const known = fixed ?? suggestions(path);
  const numeric = field.item?.kind === "number";
  const [text, setText] = useState("");

  const add = (name: string) => {
    const item: Json = numeric && Number.isFinite(Number(name)) ? Number(name) : name;
    if (name !== "" && !list.includes(item)) set([...list, item]);
    setText("");
  };
  if (fixed && fixed.length <= 4)
    return (
      <FieldFrame id={id} {...field} problems={problems} group>
        <div className="segments">
          {fixed.map((option) => (
            <button
              key={option}
              type="button"
              className="segment"
              aria-pressed={list.includes(option)}
              onClick={() =>
                set(list.includes(option) ? list.filter((one) => one !== option) : [...list, option])
              }
            >
              {words(option)}
            </button>
          ))}
        </div>
      </FieldFrame>
    );
  const open = (known ?? []).filter((name) => !list.includes(name));
  return (
    <FieldFrame id={id} {...field} problems={problems} group>
      <div className="chips">
        {list.map((item) => (
          <span className="chip" key={String(item)}>
            {words(String(item))}
            <button
              type="button"
              aria-label={`Remove ${String(item)}`}
              onClick={() => {
                const rest = list.filter((one) => one !== item);
                set(rest.length === 0 && field.optional ? undefined : rest);
              }}
            >
              ×
            </button>
          </span>
        ))}
        {known ? (
          <select
            className="chip-add"
            aria-label={`Add to ${field.title}`}
            value=""
            onChange={(event) => add(event.target.value)}
          >
            <option value="">add…</option>
            {open.map((name) => (
              <option key={name} value={name}>
                {words(name)}
              </option>
            ))}
          </select>
        ) : (
          <input
            className="chip-add"
            aria-label={`Add to ${field.title}`}
            value={text}
            placeholder="add, Enter"
            onChange={(event) => setText(event.target.value)}
            onBlur={() => add(text.trim())}
            onKeyDown={(event) => {
              if (event.key === "Enter") add(text.trim());
            }}
          />
        )}
      </div>
    </FieldFrame>
  );
}
