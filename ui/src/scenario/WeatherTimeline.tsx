import { useRef, type KeyboardEvent, type PointerEvent } from "react";
import { NumberInput } from "../form/NumberInput";
import { useForm } from "../form/context";
import { dispatch, edit } from "../state/draft";
import { getAt, setAt, startsWith, type JsonObject } from "../state/json";
import { changesOf, freeMoment, skyOf, sorted, tenth, withChanges, type WeatherChange } from "./scenario";

const GESTURE = "weather-change";
const LEAST_S = 0.1;
const LAST_S = 86_400;

/** The weather from the first step to the last: between two moments it moves in a straight line. */
export function WeatherTimeline({ document, presets, duration }: { document: JsonObject; presets: readonly string[]; duration: number }) {
  const bar = useRef<HTMLDivElement>(null);
  const { problems } = useForm();
  const changes = changesOf(document);
  const first = firstOf(document);
  const set = (make: (now: WeatherChange[]) => WeatherChange[], gesture?: string) =>
    edit((now) => withChanges(now, make(changesOf(now))), gesture);
  const endGesture = () => {
    set((now) => sorted(now), GESTURE);
    dispatch({ type: "endGesture" });
  };
  const moveTo = (index: number, at: number) =>
    set((now) => {
      const [before, after] = [now[index - 1]?.at_s ?? -LEAST_S, now[index + 1]?.at_s ?? Math.max(duration, now[index]?.at_s ?? 0) + LEAST_S];
      const held = tenth(Math.min(Math.max(at, before + LEAST_S), after - LEAST_S));
      return now.map((one, i) => (i === index ? { ...one, at_s: Math.max(0, held) } : one));
    }, GESTURE);
  const add = (at: number) =>
    set((now) => {
      const last = sorted(now).filter(({ at_s }) => at_s <= at).at(-1)?.choice ?? first.preset;
      const next = presets.find((name) => name !== last) ?? null;
      return now.some(({ at_s }) => at_s === at) ? now : sorted([...now, { at_s: at, choice: next, parameters: {} }]);
    });
  const timeAt = (clientX: number) => {
    const box = bar.current?.getBoundingClientRect();
    return box && box.width > 0 ? tenth((Math.min(Math.max(clientX - box.left, 0), box.width) / box.width) * duration) : 0;
  };
  return (
    <section className="weather-timeline" aria-label="Weather over time">
      <header className="view-head">
        <h3>Weather</h3>
        <span className="muted">{changes.length === 0 ? "the same all the time" : "changes in straight lines, then stays"}</span>
        <span className="spacer" />
        <button type="button" className="button small" onClick={() => add(freeMoment(changes, duration))}>
          Add a change
        </button>
      </header>
      <div className="weather-body">
        <div
          ref={bar}
          className="weather-bar"
          style={{ background: gradient(first.preset, changes, duration) }}
          title="Press where the weather is to change"
          onClick={(event) => event.target === event.currentTarget && add(timeAt(event.clientX))}
        >
          {changes.map((change, i) => (
            <Mark
              key={i}
              change={change}
              number={i + 1}
              duration={duration}
              onMove={(at) => moveTo(i, at)}
              onDrag={(clientX) => moveTo(i, timeAt(clientX))}
              onEnd={endGesture}
            />
          ))}
        </div>
        <div className="weather-axis" aria-hidden="true">
          <span>0 s</span>
          <span>{tenth(duration)} s</span>
        </div>
        <ol className="weather-rows" aria-label="Weather by time">
          <li>
            <span className="weather-time">At the start</span>
            {first.preset === null ? (
              <span className="muted">{first.words}</span>
            ) : (
              <PresetSelect
                label="Weather at the start"
                presets={presets}
                value={first.preset}
                onChange={(name) => edit((now) => (typeof now.weather === "string" ? { ...now, weather: name } : setAt(now, ["weather", "choice"], name)))}
              />
            )}
          </li>
          {changes.map((change, i) => {
            const wrong = problems.filter(({ path }) => startsWith(path, ["weather", "changes", i]));
            const values = Object.values(change.parameters).filter((value) => value !== null).length;
            return (
              <li key={i}>
                <span className="weather-time">
                  <NumberInput
                    id={`change-${i}-at`}
                    label={`Change ${i + 1}: at second`}
                    value={change.at_s}
                    minimum={0}
                    maximum={LAST_S}
                    wrong={wrong.length > 0}
                    onChange={(next) =>
                      typeof next === "number" && set((now) => now.map((one, k) => (k === i ? { ...one, at_s: next } : one)), GESTURE)
                    }
                    onDone={endGesture}
                  />{" "}
                  s
                </span>
                <PresetSelect
                  label={`Change ${i + 1}: weather`}
                  presets={presets}
                  value={change.choice ?? ""}
                  empty={values > 0 ? "as before" : undefined}
                  onChange={(name) => set((now) => now.map((one, k) => (k === i ? { ...one, choice: name || null } : one)))}
                />
                <button
                  type="button"
                  className="icon-button"
                  aria-label={`Remove change ${i + 1}`}
                  onClick={() => set((now) => now.filter((_, k) => k !== i))}
                >
                  ×
                </button>
                {values > 0 && <span className="muted weather-more">and {values} single values, set below Scene, More, Changes</span>}
                {change.at_s > duration && <span className="muted weather-more">after the end: the episode sees a part of the way there</span>}
                {wrong.map(({ message, hint }) => (
                  <span key={message} className="field-error weather-more">
                    {message} {hint}
                  </span>
                ))}
              </li>
            );
          })}
        </ol>
      </div>
    </section>
  );
}

interface MarkProps {
  change: WeatherChange;
  number: number;
  duration: number;
  onMove(at: number): void;
  onDrag(clientX: number): void;
  onEnd(): void;
}

/** One change on the bar: dragged, or moved by arrow keys, with Shift by a second. */
function Mark({ change, number, duration, onMove, onDrag, onEnd }: MarkProps) {
  const dragging = useRef(false);
  const keys = (event: KeyboardEvent) => {
    const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
    if (by === undefined) return;
    event.preventDefault();
    onMove(change.at_s + by * (event.shiftKey ? 1 : LEAST_S));
  };
  const end = (event: PointerEvent) => {
    if (!dragging.current) return;
    dragging.current = false;
    event.stopPropagation();
    onEnd();
  };
  const name = change.choice ?? "single values";
  return (
    <button
      type="button"
      role="slider"
      className="weather-mark"
      style={{ left: `${Math.min(100, (change.at_s / duration) * 100)}%` }}
      aria-label={`Change ${number}`}
      aria-orientation="horizontal"
      aria-valuemin={0}
      aria-valuemax={Math.max(duration, change.at_s)}
      aria-valuenow={change.at_s}
      aria-valuetext={`${name} at ${change.at_s} s`}
      title={`${name} at ${change.at_s} s`}
      onKeyDown={keys}
      onBlur={onEnd}
      onPointerDown={(event) => {
        onEnd(); // what the keys have moved before is a step of its own
        event.currentTarget.setPointerCapture(event.pointerId);
        dragging.current = true;
      }}
      onPointerMove={(event) => dragging.current && onDrag(event.clientX)}
      onPointerUp={end}
      onPointerCancel={end}
    />
  );
}

interface PresetProps {
  label: string;
  presets: readonly string[];
  value: string;
  empty?: string;
  onChange(name: string): void;
}

function PresetSelect({ label, presets, value, empty, onChange }: PresetProps) {
  const options = value === "" || presets.includes(value) ? presets : [value, ...presets];
  return (
    <select className="input compact" aria-label={label} value={value} onChange={(event) => onChange(event.target.value)}>
      {(empty !== undefined || value === "") && <option value="">{empty ?? "not set"}</option>}
      {options.map((name) => (
        <option key={name}>{name}</option>
      ))}
    </select>
  );
}

/** What holds at first, where it is one preset; else what is said instead. */
function firstOf(document: JsonObject): { preset: string | null; words: string } {
  if (typeof document.weather === "string") return { preset: document.weather, words: "" };
  const [choice, drawn] = [getAt(document, ["weather", "choice"]), getAt(document, ["weather", "random_from"])];
  if (typeof choice === "string") return { preset: choice, words: "" };
  if (!Array.isArray(drawn)) return { preset: null, words: "single values, set below Scene" };
  const words = drawn.includes("all") ? "any preset, drawn for each episode" : `one of ${drawn.join(", ")}, drawn for each episode`;
  return { preset: null, words };
}

function gradient(first: string | null, changes: readonly WeatherChange[], duration: number): string {
  let sky = skyOf(first);
  const stops = [`${sky} 0%`];
  for (const { at_s, choice } of sorted(changes)) {
    if (choice !== null) sky = skyOf(choice);
    stops.push(`${sky} ${((at_s / duration) * 100).toFixed(2)}%`);
  }
  return `linear-gradient(to right, ${stops.join(", ")}, ${sky} 100%)`;
}
