import { useMemo } from "react";
import { startsWith } from "../state/json";
import { useForm } from "./context";
import { Control } from "./Control";
import { groupsOf, type Group } from "./groups";
import type { SchemaNode } from "./schema";

/** The whole configuration but the rig: groups with the usual settings open, the others folded. */
export function ConfigForm({ schema, after }: { schema: SchemaNode; after?: Record<string, React.ReactNode> }) {
  const groups = useMemo(() => groupsOf(schema), [schema]);
  return (
    <form className="config-form" aria-label="Run parameters" onSubmit={(event) => event.preventDefault()}>
      {groups.map((group) => (
        <GroupSection key={group.name} group={group} after={after?.[group.name]} />
      ))}
    </form>
  );
}

function GroupSection({ group, after }: { group: Group; after?: React.ReactNode }) {
  const { problems } = useForm();
  const wrong = (list: Group["basic"]) =>
    problems.filter((problem) => list.some(({ path }) => startsWith(problem.path, path))).length;
  const below = wrong(group.more);
  const all = below + wrong(group.basic);
  const inner = (
    <>
      <div className="fields">
        {group.basic.map(({ path, field }) => (
          <Control key={path.join(".")} path={path} field={field} />
        ))}
      </div>
      {after}
      {group.basic.length > 0 && group.more.length > 0 && (
        <details className="more" open={below > 0 || undefined}>
          <summary>
            More
            {below > 0 && <span className="badge badge-bad">{below}</span>}
          </summary>
          <Fields group={group} />
        </details>
      )}
    </>
  );
  // A group without any usual setting is folded as a whole.
  if (group.basic.length === 0)
    return (
      <details className="group" open={all > 0 || undefined}>
        <summary>
          <h3>{group.title}</h3>
          <span className="muted">{group.hint}</span>
        </summary>
        <Fields group={group} />
      </details>
    );
  return (
    <section className="group" aria-labelledby={`group-${group.name}`}>
      <header>
        <h3 id={`group-${group.name}`}>{group.title}</h3>
        <span className="muted">{group.hint}</span>
      </header>
      {inner}
    </section>
  );
}

function Fields({ group }: { group: Group }) {
  return (
    <div className="fields">
      {group.more.map(({ path, field }) => (
        <Control key={path.join(".")} path={path} field={field} />
      ))}
    </div>
  );
}
