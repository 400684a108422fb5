import type { JsonObject } from "../state/json";
import { isObject } from "../state/json";
import { useField, useForm } from "./context";
import { FieldFrame } from "./FieldFrame";
import { ListField } from "./ListField";
import type { ControlProps } from "./simple";

const DRAWN = "\u0000drawn";

/** One name for all episodes, or several of which each episode draws one. */
export function DrawnField({ path, field }: ControlProps) {
  const { value, problems, id, set } = useField(path);
  const choice = useField([...path, "choice"]);
  const { suggestions } = useForm();
  const section: JsonObject = isObject(value) ? value : {};
  const known = suggestions([...path, "choice"]) ?? [];
  const drawn = Array.isArray(section.random_from);
  const now = typeof section.choice === "string" ? section.choice : "";
  const options = now === "" || known.includes(now) ? known : [now, ...known];
  const list = field.properties?.random_from;
  const keep = ({ choice: _, random_from: __, ...rest }: JsonObject) => rest;
  return (
    <>
      <FieldFrame
        id={id}
        title={field.title}
        description={field.description}
        problems={[...problems, ...choice.problems]}
      >
        {known.length === 0 && !drawn ? (
          <div className="free-name">
            <input
              id={id}
              className="input"
              value={now}
              spellCheck={false}
              autoComplete="off"
              placeholder="name on the server"
              aria-invalid={problems.length + choice.problems.length > 0 || undefined}
              onChange={({ target }) =>
                set({ ...keep(section), ...(target.value ? { choice: target.value } : {}) }, `name-${path.join(".")}`)
              }
            />
            <button type="button" className="button small" onClick={() => set({ ...keep(section), random_from: ["all"] })}>
              random…
            </button>
          </div>
        ) : (
        <select
          id={id}
          className="input"
          value={drawn ? DRAWN : now}
          aria-invalid={problems.length + choice.problems.length > 0 || undefined}
          onChange={({ target }) =>
            set(
              target.value === DRAWN
                ? { ...keep(section), random_from: ["all"] }
                : { ...keep(section), ...(target.value ? { choice: target.value } : {}) },
            )
          }
        >
          {(now === "" || known.length === 0) && !drawn && <option value="">not set</option>}
          {known.length === 0 && drawn && <option value="">one by its name…</option>}
          <option value={DRAWN}>random…</option>
          {options.map((name) => (
            <option key={name}>{name}</option>
          ))}
        </select>
        )}
      </FieldFrame>
      {drawn && list && (
        <ListField path={[...path, "random_from"]} field={{ ...list, optional: false, title: `${field.title}s to draw from` }} />
      )}
    </>
  );
}
