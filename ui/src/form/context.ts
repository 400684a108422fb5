import { createContext, useContext } from "react";
import type { Json, Path } from "../state/json";
import { getAt, pathText, startsWith } from "../state/json";
import type { JsonObject } from "../state/json";

/** What is wrong with a value of the document. */
export interface Problem {
  path: Path;
  message: string;
  hint: string;
}

/** What every control of a form shares. */
export interface FormContext {
  document: JsonObject;
  problems: readonly Problem[];
  /** `gesture`: changes with the same one are one undo step. */
  change(path: Path, value: Json | undefined, gesture?: string): void;
  endGesture(): void;
  /** Known good values of a field, or null. */
  suggestions(path: Path): readonly string[] | null;
}

export const Form = createContext<FormContext | null>(null);

export function useForm(): FormContext {
  const form = useContext(Form);
  if (!form) throw new Error("a field stands outside of a form");
  return form;
}

export interface FieldState {
  value: Json | undefined;
  problems: readonly Problem[];
  id: string;
  set(value: Json | undefined, gesture?: string): void;
}

/** Value, problems and setter of one place. Problems below it count unless `exact`. */
export function useField(path: Path, exact = true): FieldState {
  const form = useForm();
  return {
    value: getAt(form.document, path),
    problems: form.problems.filter((problem) =>
      exact
        ? pathText(problem.path) === pathText(path)
        : startsWith(problem.path, path) || pathText(problem.path) === pathText(path),
    ),
    id: `field-${path.join("-")}`,
    set: (value, gesture) => form.change(path, value, gesture),
  };
}
