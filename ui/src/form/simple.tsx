import type { Json, Path } from "../state/json";
import { pathText } from "../state/json";
import { useField, useForm } from "./context";
import { FieldFrame } from "./FieldFrame";
import { NumberInput } from "./NumberInput";
import type { Field } from "./schema";

export interface ControlProps {
  path: Path;
  field: Field;
}

/** The value, or what holds where nothing is given. */
function effective(field: Field, value: Json | undefined): Json | undefined {
  return value === undefined ? field.node.default : value;
}

export function Toggle({ path, field }: ControlProps) {
  const { value, problems, id, set } = useField(path);
  return (
    <FieldFrame id={id} {...field} problems={problems} inline>
      <input
        id={id}
        type="checkbox"
        role="switch"
        className="switch"
        checked={effective(field, value) === true}
        onChange={(event) => set(event.target.checked)}
      />
    </FieldFrame>
  );
}

export function NumberField({ path, field }: ControlProps) {
  const { value, problems, id, set } = useField(path);
  const { endGesture } = useForm();
  const fallback = field.node.default;
  return (
    <FieldFrame id={id} {...field} problems={problems}>
      <NumberInput
        id={id}
        value={typeof value === "number" ? value : undefined}
        placeholder={typeof fallback === "number" ? String(fallback) : "not set"}
        whole={field.whole}
        minimum={field.minimum}
        maximum={field.maximum}
        wrong={problems.length > 0}
        describedBy={problems.length > 0 ? `${id}-error` : undefined}
        onChange={(next) => set(next ?? (field.optional ? undefined : ""), pathText(path))}
        onDone={endGesture}
      />
    </FieldFrame>
  );
}

export function TextField({ path, field }: ControlProps) {
  const { value, problems, id, set } = useField(path);
  const { suggestions, endGesture } = useForm();
  const known = suggestions(path);
  const shown = typeof value === "string" ? value : "";
  const wrong = problems.length > 0;
  return (
    <FieldFrame id={id} {...field} problems={problems}>
      <input
        id={id}
        className="input"
        type="text"
        value={shown}
        list={known ? `${id}-known` : undefined}
        placeholder={typeof field.node.default === "string" ? field.node.default : "not set"}
        spellCheck={false}
        autoComplete="off"
        aria-invalid={wrong || undefined}
        aria-describedby={wrong ? `${id}-error` : undefined}
        onChange={(event) =>
          set(event.target.value === "" && field.optional ? undefined : event.target.value, pathText(path))
        }
        onBlur={endGesture}
      />
      {known && (
        <datalist id={`${id}-known`}>
          {known.map((name) => (
            <option key={name} value={name} />
          ))}
        </datalist>
      )}
    </FieldFrame>
  );
}

/** A text whose known values are few enough to choose from. */
export function NameField({ path, field, names }: ControlProps & { names: readonly string[] }) {
  const { value, problems, id, set } = useField(path);
  const shown = String(effective(field, value) ?? "");
  const options = names.includes(shown) || shown === "" ? names : [shown, ...names];
  return (
    <FieldFrame id={id} {...field} problems={problems}>
      <select
        id={id}
        className="input"
        value={shown}
        aria-invalid={problems.length > 0 || undefined}
        onChange={(event) => set(event.target.value || undefined)}
      >
        {(field.optional || shown === "") && <option value="">not set</option>}
        {options.map((name) => (
          <option key={name}>{name}</option>
        ))}
      </select>
    </FieldFrame>
  );
}

export function EnumField({ path, field }: ControlProps) {
  const { value, problems, id, set } = useField(path);
  const options = (field.options ?? []).map(String);
  const shown = String(effective(field, value) ?? "");
  const short = options.length <= 4 && options.join("").length <= 30 && !field.optional;
  if (short)
    return (
      <FieldFrame id={id} {...field} problems={problems} group>
        <div className="segments">
          {options.map((option) => (
            <button
              key={option}
              type="button"
              className="segment"
              aria-pressed={option === shown}
              onClick={() => set(option)}
            >
              {words(option)}
            </button>
          ))}
        </div>
      </FieldFrame>
    );
  return (
    <FieldFrame id={id} {...field} problems={problems}>
      <select
        id={id}
        className="input"
        value={shown}
        onChange={(event) => set(event.target.value === "" ? undefined : event.target.value)}
      >
        {field.optional && <option value="">not set</option>}
        {options.map((option) => (
          <option key={option} value={option}>
            {words(option)}
          </option>
        ))}
      </select>
    </FieldFrame>
  );
}

export function PairField({ path, field }: ControlProps) {
  const { value, problems, id, set } = useField(path, false);
  const { endGesture } = useForm();
  const parts = field.alternatives ?? [];
  const list = Array.isArray(effective(field, value)) ? (effective(field, value) as Json[]) : [];
  const names =
    field.unit === "px" ? ["Width", "Height"] : parts.length === 3 ? ["Red", "Green", "Blue"] : ["Low", "High"];
  return (
    <FieldFrame id={id} {...field} problems={problems} group>
      <div className="pair">
        {parts.map((part, index) => (
          <NumberInput
            key={names[index]}
            id={`${id}-${index}`}
            label={`${field.title}: ${names[index]}`}
            value={typeof list[index] === "number" ? list[index] : undefined}
            placeholder={names[index]}
            whole={part.whole}
            minimum={part.minimum}
            maximum={part.maximum}
            wrong={problems.some((problem) => problem.path.at(-1) === index)}
            onChange={(next) =>
              set(
                parts.map((_, i) => (i === index ? (next ?? "") : (list[i] ?? 0))),
                pathText(path),
              )
            }
            onDone={endGesture}
          />
        ))}
      </div>
    </FieldFrame>
  );
}

/** `stage_vo` as words. */
export function words(name: string): string {
  return name.replaceAll("_", " ");
}
