/** Plain JSON, paths into it, and changes that leave the original alone. */
export type Json = null | boolean | number | string | Json[] | JsonObject;
export interface JsonObject {
  [key: string]: Json | undefined;
}
export type Path = readonly (string | number)[];

export function isObject(value: unknown): value is JsonObject {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

export function getAt(root: Json | undefined, path: Path): Json | undefined {
  let here: Json | undefined = root;
  for (const part of path) {
    if (Array.isArray(here)) here = here[Number(part)];
    else if (isObject(here)) here = here[String(part)];
    else return undefined;
  }
  return here;
}

/** A copy with another value at a path; `undefined` takes the key away. Sections on the way are made. */
export function setAt(root: JsonObject, path: Path, value: Json | undefined): JsonObject {
  return put(root, path, value) as JsonObject;
}

function put(here: Json | undefined, path: Path, value: Json | undefined): Json | undefined {
  const [head, ...rest] = path;
  if (head === undefined) return value;
  if (typeof head === "number") {
    const list = Array.isArray(here) ? [...here] : [];
    const made = put(list[head], rest, value);
    if (made === undefined) list.splice(head, 1);
    else list[head] = made;
    return list;
  }
  const object: JsonObject = isObject(here) ? { ...here } : {};
  const made = put(object[head], rest, value);
  if (made === undefined) delete object[head];
  else object[head] = made;
  return object;
}

export function pathText(path: Path): string {
  return path.reduce<string>(
    (text, part) => (typeof part === "number" ? `${text}[${part}]` : text ? `${text}.${part}` : part),
    "",
  );
}

export function startsWith(path: Path, prefix: Path): boolean {
  return prefix.length <= path.length && prefix.every((part, i) => String(path[i]) === String(part));
}

export function equal(a: Json | undefined, b: Json | undefined): boolean {
  return a === b || JSON.stringify(a) === JSON.stringify(b);
}
