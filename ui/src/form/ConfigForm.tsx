import { Fragment, useMemo, useState } from "react";
import { equal, getAt, startsWith, type JsonObject, type Path } from "../state/json";
import { useForm } from "./context";
import { Control } from "./Control";
import { fitsFilter, groupsOf, headingOf, type Filter, type Group, type Placed } from "./groups";
import type { SchemaNode } from "./schema";

const FILTERS: Record<Filter, string> = { all: "All", paper: "Paper", changed: "Changed" };

interface Props {
  schema: SchemaNode;
  defaults: JsonObject;
  after?: Record<string, React.ReactNode>;
}

/** The whole configuration but the rig: groups with the usual settings open, the others folded. */
export function ConfigForm({ schema, defaults, after }: Props) {
  const groups = useMemo(() => groupsOf(schema), [schema]);
  const { document } = useForm();
  const [filter, setFilter] = useState<Filter>("all");
  const [words, setWords] = useState("");
  const looking = filter !== "all" || words.trim() !== "";
  const changed = (path: Path) => {
    const [mine, usual] = [getAt(document, path), getAt(defaults, path)];
    return mine !== undefined && !equal(mine, usual);
  };
  const found = groups.flatMap((group) => {
    const all = [...group.basic, ...group.more].filter((one) => fitsFilter(one, filter, words.trim(), changed));
    return all.length > 0 ? [{ group, all }] : [];
  });
  return (
    <form className="config-form" aria-label="Run parameters" onSubmit={(event) => event.preventDefault()}>
      <div className="form-search" role="search">
        <input
          type="search"
          className="input"
          aria-label="Search the settings"
          placeholder="Search the settings"
          value={words}
          onChange={(event) => setWords(event.target.value)}
        />
        <div className="segments small" role="group" aria-label="Settings to show">
          {(Object.keys(FILTERS) as Filter[]).map((one) => (
            <button key={one} type="button" className="segment" aria-pressed={one === filter} onClick={() => setFilter(one)}>
              {FILTERS[one]}
            </button>
          ))}
        </div>
      </div>
      {!looking && groups.map((group) => <GroupSection key={group.name} group={group} after={after?.[group.name]} />)}
      {looking &&
        found.map(({ group, all }) => (
          <section key={group.name} className="group" aria-labelledby={`found-${group.name}`}>
            <header>
              <h3 id={`found-${group.name}`}>{group.title}</h3>
            </header>
            <Fields placed={all} />
            {after?.[group.name]}
          </section>
        ))}
      {looking && found.length === 0 && (
        <p className="empty" role="status">
          No setting fits. Sensors have theirs beside the views of the car.
        </p>
      )}
      {filter === "paper" && found.length > 0 && (
        <p className="muted form-note">
          Resolution and points of each LiDAR, and ego motion by IMU and GNSS, are set at the sensors; the destination
          below.
        </p>
      )}
    </form>
  );
}

function GroupSection({ group, after }: { group: Group; after?: React.ReactNode }) {
  const { problems } = useForm();
  const wrong = (list: Group["basic"]) =>
    problems.filter((problem) => list.some(({ path }) => startsWith(problem.path, path))).length;
  const below = wrong(group.more);
  const all = below + wrong(group.basic);
  // A group without any usual setting is folded as a whole.
  if (group.basic.length === 0)
    return (
      <details className="group" open={all > 0 || undefined}>
        <summary>
          <h3>{group.title}</h3>
          <span className="muted">{group.hint}</span>
        </summary>
        <Fields placed={group.more} />
      </details>
    );
  return (
    <section className="group" aria-labelledby={`group-${group.name}`}>
      <header>
        <h3 id={`group-${group.name}`}>{group.title}</h3>
        <span className="muted">{group.hint}</span>
      </header>
      <Fields placed={group.basic} />
      {after}
      {group.more.length > 0 && (
        <details className="more" open={below > 0 || undefined}>
          <summary>
            More
            {below > 0 && <span className="badge badge-bad">{below}</span>}
          </summary>
          <Fields placed={group.more} />
        </details>
      )}
    </section>
  );
}

function Fields({ placed }: { placed: readonly Placed[] }) {
  return (
    <div className="fields">
      {placed.map(({ path, field }, at) => {
        const heading = headingOf(placed, at);
        return (
          <Fragment key={path.join(".")}>
            {heading && <h4 className="part">{heading}</h4>}
            <Control path={path} field={field} />
          </Fragment>
        );
      })}
    </div>
  );
}
