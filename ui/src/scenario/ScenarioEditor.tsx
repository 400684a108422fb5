import { useMemo, useState } from "react";
import { edit } from "../state/draft";
import { getAt, type JsonObject } from "../state/json";
import { EditorChoice } from "./EditorChoice";
import { MapCanvas } from "./MapCanvas";
import { kindOfScenario, mapsOf, startOf, stopsOf, withStart, withStops } from "./scenario";
import { ScenarioPlaces } from "./ScenarioPlaces";
import { useTownMap, type Place } from "./townMap";
import { WeatherTimeline } from "./WeatherTimeline";

interface Props {
  document: JsonObject;
  defaults: JsonObject;
  /** Maps that the server is known to have. */
  maps: readonly string[];
  presets: readonly string[];
}

/** Where the ego begins and drives, who else is there, and how the weather goes: the same document as the form's. */
export function ScenarioEditor({ document, defaults, maps, presets }: Props) {
  const [tool, setTool] = useState<"start" | "route">("start");
  const [told, setTold] = useState("");
  const [wanted, setWanted] = useState<string | null>(null);
  const names = useMemo(() => mapsOf(document, maps), [document, maps]);
  const shown = wanted !== null && names.includes(wanted) ? wanted : (names[0] ?? null);
  const { town, note } = useTownMap(document.server, shown);
  const replay = ["replay", "log", "scenic", "openscenario"].includes(kindOfScenario(document));
  const valueOf = (...path: string[]) => getAt(document, path) ?? getAt(defaults, path);
  const duration = Number(valueOf("duration_s")) || 1;
  const start = startOf(document);
  const stops = stopsOf(document);

  const pick = (place: number | Place) => {
    const where = typeof place === "number" ? `spawn point ${place}` : `the place ${place.x}, ${place.y}`;
    if (tool === "start") {
      edit((now) => withStart(now, place));
      setTold(`The ego starts at ${where}.`);
    } else {
      const stop = typeof place === "number" ? place : { x: place.x, y: place.y };
      edit((now) => withStops(now, [...stopsOf(now), stop]));
      setTold(`The route leads through ${where}.`);
    }
  };
  const circles = (["vehicles", "pedestrians"] as const).flatMap((who) => {
    const radius = valueOf(who, "radius_m");
    return Number(valueOf(who, "count")) > 0 && typeof radius === "number" ? [{ label: who, radius }] : [];
  });
  return (
    <>
      <section className="panel scenario" aria-label="Scenario">
        <header className="panel-head toolbar">
          <h2>Scenario</h2>
          <EditorChoice />
          <div className="segments small" role="group" aria-label="What a press on the map sets">
            {(["start", "route"] as const).map((one) => (
              <button key={one} type="button" className="segment" aria-pressed={one === tool} disabled={replay} onClick={() => setTool(one)}>
                {one === "start" ? "Set start" : "Set route"}
              </button>
            ))}
          </div>
          {names.length > 1 && (
            <label className="inline-label">
              <span className="muted">Drawn:</span>
              <select className="input compact" aria-label="Map to show" value={shown ?? ""} onChange={(event) => setWanted(event.target.value)}>
                {names.map((name) => (
                  <option key={name}>{name}</option>
                ))}
              </select>
            </label>
          )}
        </header>
        <MapCanvas
          key={shown}
          town={town}
          note={note}
          start={replay ? "random" : start}
          stops={stops}
          circles={replay ? [] : circles}
          tool={replay ? null : tool}
          onPick={pick}
          onTell={setTold}
        />
        <p className="scenario-told muted" role="status">
          {told || (tool === "start" ? "Press on an arrow or a road: the ego starts there." : "Press on arrows or roads, in the order of the way.")}
        </p>
        <WeatherTimeline document={document} presets={presets} duration={duration} />
      </section>
      <ScenarioPlaces
        document={document}
        spawnPoints={town?.spawn_points?.length ?? 0}
        severalMaps={names.length > 1}
        replay={replay}
        vehicles={othersText(valueOf, "vehicles")}
        pedestrians={othersText(valueOf, "pedestrians")}
      />
    </>
  );
}

function othersText(valueOf: (...path: string[]) => unknown, who: "vehicles" | "pedestrians"): string {
  const groups = valueOf(who, "groups");
  const more = (Array.isArray(groups) ? (groups as JsonObject[]) : []).reduce((sum, one) => sum + Number(one.count ?? 0), 0);
  const radius = valueOf(who, "radius_m");
  const where = typeof radius === "number" ? `within ${radius} m of the start` : "anywhere on the map";
  return `${Number(valueOf(who, "count") ?? 0) + more} ${who}, ${where}`;
}
