import { useEffect, useMemo, useState } from "react";
import { useAnswer } from "../api/useAnswer";
import type { Description, Releases, SchemaMessage, ServerCheck } from "../api/types";
import { ConfigForm } from "../form/ConfigForm";
import { Form, type FormContext } from "../form/context";
import type { SchemaNode } from "../form/schema";
import { kindOf } from "../rig/kinds";
import { RigEditor } from "../rig/RigEditor";
import { useEditor } from "../scenario/EditorChoice";
import { ScenarioEditor } from "../scenario/ScenarioEditor";
import { dispatch, draft, edit } from "../state/draft";
import { getAt, isObject, setAt, type JsonObject, type Path } from "../state/json";
import { useStore } from "../state/store";
import { Icon } from "../ui/Icon";
import { Conflict } from "./Conflict";
import { ConfigFiles } from "./ConfigFiles";
import { ServerTest } from "./ServerTest";
import { factsOf, isEmbedded, serverFacts } from "./serverFacts";
import { StartBar } from "./StartBar";
import { YamlView } from "./YamlView";

/** Parameters and rig side by side. */
export function ConfigurePage() {
  const schema = useAnswer<SchemaMessage>("/schema");
  const description = useAnswer<Description>("/description");
  const { history, problems, loaded } = useStore(draft, (now) => now);
  const facts = useStore(serverFacts, (now) => now);
  const releases = useAnswer<Releases>("/server/releases");
  const [text, setText] = useState(false);
  const document = history.present;
  const editor = useEditor();

  const form: FormContext = useMemo(
    () => ({
      document,
      problems,
      change: (path, value, gesture) => edit((now) => setAt(now, path, value), gesture),
      endGesture: () => dispatch({ type: "endGesture" }),
      suggestions: (path) => suggestions(path, document, {
        description: description.data,
        schema: schema.data,
        server: factsOf(document, facts),
        releases: releases.data?.folders ?? [],
      }),
    }),
    [document, problems, description.data, schema.data, facts, releases.data],
  );
  useUndoKeys();

  if (schema.error) return <p className="empty page-error">{schema.error}</p>;
  if (!schema.data || !loaded) return <Skeleton />;
  const own = schema.data.config_schema as SchemaNode;
  return (
    <Form.Provider value={form}>
      <main className={`configure${text ? " with-text" : ""}`}>
        <h1 className="sr-only">Configure</h1>
        <section className="panel parameters" aria-label="Parameters">
          <header className="panel-head">
            <h2>Parameters</h2>
            <span className="spacer" />
            <HistoryButtons />
            <ConfigFiles schema={schema.data} text={text} onText={() => setText(!text)} />
          </header>
          <Conflict />
          {text ? (
            <YamlView />
          ) : (
            <ConfigForm schema={own} defaults={schema.data.defaults as JsonObject} after={{ server: <ServerTest document={document} /> }} />
          )}
          <StartBar />
        </section>
        {editor === "rig" ? (
          <RigEditor document={document} schema={schema.data} />
        ) : (
          <ScenarioEditor
            document={document}
            defaults={schema.data.defaults as JsonObject}
            maps={mapsKnown(document, description.data, factsOf(document, facts))}
            presets={schema.data.weather_presets}
          />
        )}
      </main>
    </Form.Provider>
  );
}

function HistoryButtons() {
  const { past, future } = useStore(draft, (now) => now.history);
  return (
    <div className="button-row">
      <button
        type="button"
        className="icon-button"
        aria-label="Undo"
        title="Undo (Ctrl-Z)"
        disabled={past.length === 0}
        onClick={() => dispatch({ type: "undo" })}
      >
        <Icon name="undo" />
      </button>
      <button
        type="button"
        className="icon-button"
        aria-label="Redo"
        title="Redo (Ctrl-Shift-Z)"
        disabled={future.length === 0}
        onClick={() => dispatch({ type: "redo" })}
      >
        <Icon name="redo" />
      </button>
    </div>
  );
}

/** Where text is typed that is no setting, and undone by the browser. */
const OTHER_TEXT = "textarea, dialog, .start-bar, .form-search, input.chip-add";

/** Ctrl-Z and Ctrl-Shift-Z anywhere on the page, but for text that is no setting. */
function useUndoKeys() {
  useEffect(() => {
    const keys = (event: KeyboardEvent) => {
      if (!(event.ctrlKey || event.metaKey) || (event.target as HTMLElement).closest(OTHER_TEXT)) return;
      const key = event.key.toLowerCase();
      if (key === "z") dispatch({ type: event.shiftKey ? "redo" : "undo" });
      else if (key === "y") dispatch({ type: "redo" });
      else return;
      event.preventDefault();
    };
    window.addEventListener("keydown", keys);
    return () => window.removeEventListener("keydown", keys);
  }, []);
}

interface Known {
  description: Description | null;
  schema: SchemaMessage | null;
  server: ServerCheck | null;
  releases: readonly string[];
}

/** `/Game/Carla/Maps/Town01` as configurations name it. */
function shortMap(name: string): string {
  return name.split("/").at(-1) ?? name;
}

/** The maps of the chosen server; never the embedded ones for another one, as those are not there. */
function mapsKnown(document: JsonObject, description: Description | null, server: ServerCheck | null): string[] {
  if (isEmbedded(document)) return description?.maps.map(({ name }) => name) ?? [];
  return (server?.maps ?? []).map(shortMap);
}

/** Names that a server or this document knows, by where they are asked for. */
function suggestions(
  path: Path,
  document: JsonObject,
  { description, schema, server, releases }: Known,
): readonly string[] | null {
  const [section, key] = [String(path[0]), String(path.at(-1))];
  const embedded = isEmbedded(document);
  if (section === "server" && key === "path") return releases;
  if (section === "map" && (key === "choice" || key === "random_from")) {
    const maps = mapsKnown(document, description, server);
    return key === "random_from" ? ["all", ...maps] : maps;
  }
  if (section === "weather" && key === "choice") return schema?.weather_presets ?? null;
  if (section === "weather" && key === "random_from") return ["all", ...(schema?.weather_presets ?? [])];
  if (section === "ego" && key === "blueprint")
    return embedded ? (description?.vehicles.map(({ id }) => id).sort() ?? null) : (server?.vehicles ?? null);
  if (key === "base_type") return ["car", "van", "truck", "bus", "motorcycle", "bicycle"];
  if ((section === "labels" && (key === "cameras" || key === "lidars")) || (section === "conversion" && key === "codecs")) {
    const listed = getAt(document, ["rig", "sensors"]);
    const sensors = (Array.isArray(listed) ? listed : []).filter(isObject);
    const fits = ({ kind }: JsonObject) =>
      key === "codecs" || (key === "lidars" ? kind === "lidar" : kindOf(String(kind))?.modality === "camera");
    return sensors.filter(fits).map((one) => String(one.id));
  }
  return null;
}

function Skeleton() {
  return (
    <main className="configure" aria-busy="true" aria-label="Loading">
      <div className="panel skeleton" />
      <div className="panel skeleton" />
      <div className="panel skeleton" />
    </main>
  );
}
