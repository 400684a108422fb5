import { useState } from "react";
import type { Json } from "../state/json";
import { isObject } from "../state/json";
import { useField, useForm } from "./context";
import { Control } from "./Control";
import { FieldFrame } from "./FieldFrame";
import { alternativeOf, initial, type Field } from "./schema";
import { words, type ControlProps } from "./simple";

/** A section of several settings, folded when it is inside another. */
export function SectionField({ path, field }: ControlProps) {
  const { problems } = useField(path, false);
  const entries = Object.entries(field.properties ?? {});
  return (
    <details className="subsection" open={problems.length > 0 || undefined}>
      <summary>
        {field.title || words(String(path.at(-1)))}
        {problems.length > 0 && <span className="badge badge-bad">{problems.length}</span>}
      </summary>
      <div className="fields">
        {entries.map(([key, own]) => (
          <Control key={key} path={[...path, key]} field={own} />
        ))}
      </div>
    </details>
  );
}

/** One of several kinds of section, told apart by a key such as `kind`. */
export function VariantsField({ path, field }: ControlProps) {
  const { value, problems, id, set } = useField(path);
  const key = field.discriminator ?? "kind";
  const names = Object.keys(field.variants ?? {});
  const now = isObject(value) && typeof value[key] === "string" ? value[key] : (names[0] ?? "");
  const section = field.variants?.[now];
  const needed = new Set(section?.node.required ?? []);
  const entries = Object.entries(section?.properties ?? {}).filter(([name]) => name !== key);
  const first = entries.filter(([name]) => needed.has(name) || (now === "remote" && name === "port"));
  const more = entries.filter((entry) => !first.includes(entry));
  const choose = (name: string) => {
    const variant = field.variants?.[name];
    if (variant) set({ ...(initial(variant) as Record<string, Json>), [key]: name });
  };
  return (
    <>
      <FieldFrame id={id} {...field} problems={problems}>
        <select id={id} className="input" value={now} onChange={(event) => choose(event.target.value)}>
          {names.map((name) => (
            <option key={name} value={name}>
              {words(name)}
            </option>
          ))}
        </select>
      </FieldFrame>
      {first.map(([name, own]) => (
        <Control key={name} path={[...path, name]} field={own} />
      ))}
      {more.length > 0 && (
        <SectionField
          path={path}
          field={{ ...field, kind: "section", title: `${field.title} details`, properties: Object.fromEntries(more) }}
        />
      )}
    </>
  );
}

/** `auto` or a number, a number or a range, `random` or a place: first which, then what. */
export function ChoicesField({ path, field }: ControlProps) {
  const { value, problems, id, set } = useField(path);
  const alternatives = field.alternatives ?? [];
  const given = value === undefined ? field.node.default : value;
  const [before, setBefore] = useState(-1);
  const index = alternativeOf(alternatives, given, before);
  if (index !== before) setBefore(index);
  const chosen = alternatives[index];
  const name = (one: Field) =>
    one.kind === "const"
      ? words(String(one.node.const))
      : one.kind === "enum"
        ? words((one.options ?? []).join(" / "))
        : one.kind === "pair"
          ? alternatives.length > 2 || one.alternatives?.length === 3
            ? "values"
            : "range"
          : one.kind === "number"
            ? one.whole && alternatives.length > 2
              ? "index"
              : "value"
            : one.kind === "list"
              ? "list"
              : one.kind === "section"
                ? "place"
                : one.kind;
  return (
    <FieldFrame id={id} {...field} problems={chosen && chosen.kind !== "const" ? [] : problems}>
      <div className="choices">
        <select
          id={id}
          className="input"
          value={index}
          onChange={(event) => {
            const next = alternatives[Number(event.target.value)];
            set(next ? initial(next) : undefined);
          }}
        >
          {(field.optional || index < 0) && <option value={-1}>not set</option>}
          {alternatives.map((one, i) => (
            <option key={i} value={i}>
              {name(one)}
            </option>
          ))}
        </select>
        {chosen && chosen.kind !== "const" && (
          <div className="bare">
            <Control path={path} field={{ ...chosen, title: field.title, description: "", unit: field.unit }} />
          </div>
        )}
      </div>
    </FieldFrame>
  );
}

/** A list of sections, each a row with its own settings. */
export function RowsField({ path, field }: ControlProps) {
  const { value, problems, id, set } = useField(path);
  const rows = Array.isArray(value) ? value : [];
  const item = field.item;
  if (!item) return null;
  return (
    <FieldFrame id={id} {...field} problems={problems} group>
      {rows.map((_, index) => (
        <div className="row-card" key={index}>
          <button
            type="button"
            className="row-remove"
            aria-label={`Remove ${field.title} ${index + 1}`}
            onClick={() => set(rows.filter((__, i) => i !== index))}
          >
            ×
          </button>
          {item.kind === "section" ? (
            <div className="fields">
              {Object.entries(item.properties ?? {}).map(([key, own]) => (
                <Control key={key} path={[...path, index, key]} field={own} />
              ))}
            </div>
          ) : (
            <Control path={[...path, index]} field={{ ...item, title: `${field.title} ${index + 1}` }} />
          )}
        </div>
      ))}
      <button type="button" className="button small" onClick={() => set([...rows, initial(item)])}>
        Add to {field.title.toLowerCase()}
      </button>
    </FieldFrame>
  );
}

/** A mapping of names to texts, such as the codec of single sensors. */
export function MappingField({ path, field }: ControlProps) {
  const { value, problems, id, set } = useField(path, false);
  const { suggestions } = useForm();
  const entries = isObject(value) ? Object.entries(value) : [];
  const open = (suggestions(path) ?? []).filter((name) => !entries.some(([key]) => key === name));
  return (
    <FieldFrame id={id} {...field} problems={problems} group>
      {entries.map(([key, text]) => (
        <div className="mapping" key={key}>
          <span>{key}</span>
          <input
            className="input"
            aria-label={`${field.title}: ${key}`}
            value={String(text ?? "")}
            onChange={(event) => set({ ...(value as Record<string, Json>), [key]: event.target.value }, id)}
          />
          <button
            type="button"
            className="icon-button"
            aria-label={`Remove ${key}`}
            onClick={() => set(Object.fromEntries(entries.filter(([one]) => one !== key)))}
          >
            ×
          </button>
        </div>
      ))}
      <select
        className="chip-add"
        aria-label={`Add to ${field.title}`}
        value=""
        onChange={(event) => {
          if (event.target.value) set({ ...Object.fromEntries(entries), [event.target.value]: "" });
        }}
      >
        <option value="">add…</option>
        {open.map((name) => (
          <option key={name}>{name}</option>
        ))}
      </select>
    </FieldFrame>
  );
}
