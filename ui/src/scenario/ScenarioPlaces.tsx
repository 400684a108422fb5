import type { ReactNode } from "react";
import { edit } from "../state/draft";
import type { JsonObject } from "../state/json";
import { useForm } from "../form/context";
import { startsWith } from "../state/json";
import { kindOfScenario, moved, startOf, stopsOf, withStart, withStops, type Stop } from "./scenario";

interface Props {
  document: JsonObject;
  spawnPoints: number;
  severalMaps: boolean;
  replay: boolean;
  vehicles: string;
  pedestrians: string;
}

/** Start and route as lists: what the map shows, and another way to choose it. */
export function ScenarioPlaces({ document, spawnPoints, severalMaps, replay, vehicles, pedestrians }: Props) {
  const { problems } = useForm();
  const start = startOf(document);
  const stops = stopsOf(document);
  const wrong = problems.filter(({ path }) => startsWith(path, ["ego", "spawn"]) || startsWith(path, ["scenario"]));
  const set = (make: (now: Stop[]) => Stop[]) => edit((now) => withStops(now, make(stopsOf(now))));
  if (replay)
    return (
      <Panel>
        <p className="empty">
          A recorded episode is played again: its map, start, ways and traffic are used, not those of this configuration. Only the
          weather is this configuration’s own.
        </p>
      </Panel>
    );
  return (
    <Panel>
      <div className="places">
        <h3>Start</h3>
        <select
          className="input"
          aria-label="Start of the ego"
          value={typeof start === "object" ? "place" : String(start)}
          onChange={(event) => edit((now) => withStart(now, event.target.value === "random" ? "random" : Number(event.target.value)))}
        >
          <option value="random">random: drawn for each episode</option>
          {typeof start === "object" && <option value="place">{`place ${start.x}, ${start.y}`}</option>}
          {numbers(spawnPoints, start).map((i) => (
            <option key={i} value={i}>{`spawn point ${i}`}</option>
          ))}
        </select>
        {severalMaps && start !== "random" && (
          <p className="muted">Maps are drawn for each episode: on each of them this is another place.</p>
        )}
        <h3>Route</h3>
        {stops.length === 0 && (
          <p className="muted">
            {kindOfScenario(document) === "stationary"
              ? "None: the ego stands still. A first place makes it drive."
              : "None: the ego drives where traffic leads it."}
          </p>
        )}
        {stops.length > 0 && (
          <>
            <ol className="stops" aria-label="Places of the route">
              {stops.map((stop, i) => (
                <li key={i}>
                  <span className="stop-name">{nameOf(stop)}</span>
                  <button type="button" className="icon-button" aria-label={`Earlier, place ${i + 1}`} disabled={i === 0} onClick={() => set((now) => moved(now, i, i - 1))}>
                    ↑
                  </button>
                  <button
                    type="button"
                    className="icon-button"
                    aria-label={`Later, place ${i + 1}`}
                    disabled={i === stops.length - 1}
                    onClick={() => set((now) => moved(now, i, i + 1))}
                  >
                    ↓
                  </button>
                  <button type="button" className="icon-button" aria-label={`Remove place ${i + 1}`} onClick={() => set((now) => now.filter((_, k) => k !== i))}>
                    ×
                  </button>
                </li>
              ))}
            </ol>
            <p className="muted">By the shortest way over the lanes; after the last place the ego drives on.</p>
          </>
        )}
        <div className="button-row">
          <select
            className="input compact"
            aria-label="Add a spawn point to the route"
            value=""
            disabled={spawnPoints === 0}
            onChange={(event) => event.target.value !== "" && set((now) => [...now, Number(event.target.value)])}
          >
            <option value="">Add a spawn point…</option>
            {numbers(spawnPoints, null).map((i) => (
              <option key={i} value={i}>{`spawn point ${i}`}</option>
            ))}
          </select>
          {stops.length > 0 && (
            <button type="button" className="button small" onClick={() => set(() => [])}>
              Clear
            </button>
          )}
        </div>
        {wrong.map(({ message, hint }) => (
          <p key={message} className="field-error">
            {message} {hint}
          </p>
        ))}
        <h3>Others</h3>
        <ul className="others">
          <li>{vehicles}</li>
          <li>{pedestrians}</li>
        </ul>
        <p className="muted">Their numbers and how they drive stand in the parameters below Traffic.</p>
      </div>
    </Panel>
  );
}

function nameOf(stop: Stop): string {
  return typeof stop === "number" ? `spawn point ${stop}` : `place ${stop.x}, ${stop.y}`;
}

/** All numbers of spawn points, and the chosen one even where the map does not tell how many it has. */
function numbers(count: number, start: unknown): number[] {
  const list = Array.from({ length: count }, (_, i) => i);
  return typeof start === "number" && start >= count ? [...list, start] : list;
}

function Panel({ children }: { children: ReactNode }) {
  return (
    <aside className="panel sensors" aria-label="Places">
      <header className="panel-head">
        <h2>Places</h2>
      </header>
      {children}
    </aside>
  );
}
