import { describe, expect, test } from "vitest";
import { emptyHistory, reduceHistory, type History, type HistoryAction } from "../src/state/history";
import { getAt, setAt } from "../src/state/json";

function after(...actions: HistoryAction[]): History {
  return actions.reduce(reduceHistory, emptyHistory({ fps: 10 }));
}
const edit = (fps: number, gesture?: string): HistoryAction => ({ type: "edit", document: { fps }, gesture });

describe("history", () => {
  test("undo and redo walk through what was", () => {
    const state = after(edit(20), edit(30), { type: "undo" });
    expect(state.present).toEqual({ fps: 20 });
    expect(reduceHistory(state, { type: "redo" }).present).toEqual({ fps: 30 });
    expect(reduceHistory(state, { type: "undo" }).present).toEqual({ fps: 10 });
  });
  test("changes of one gesture are one step", () => {
    const state = after(edit(11, "drag-1"), edit(12, "drag-1"), edit(13, "drag-1"), { type: "undo" });
    expect(state.present).toEqual({ fps: 10 });
  });
  test("a gesture that has ended is not gone on with", () => {
    const state = after(edit(11, "drag"), { type: "endGesture" }, edit(12, "drag"), { type: "undo" });
    expect(state.present).toEqual({ fps: 11 });
  });
  test("a change after undo forgets what was undone", () => {
    const state = after(edit(20), { type: "undo" }, edit(30));
    expect(state.future).toEqual([]);
    expect(reduceHistory(state, { type: "redo" })).toBe(state);
  });
  test("what changes nothing is no step", () => {
    expect(after(edit(10)).past).toEqual([]);
  });
  test("somebody else's document cannot be undone into mine", () => {
    const state = after(edit(20), { type: "adopt", document: { fps: 99 } }, { type: "undo" });
    expect(state.present).toEqual({ fps: 99 });
  });
});

describe("paths", () => {
  const document = { rig: { sensors: [{ id: "A" }, { id: "B" }] } };
  test("a value is set in a copy", () => {
    const changed = setAt(document, ["rig", "sensors", 1, "id"], "C");
    expect(getAt(changed, ["rig", "sensors", 1, "id"])).toBe("C");
    expect(document.rig.sensors[1]).toEqual({ id: "B" });
  });
  test("sections on the way are made, undefined takes away", () => {
    expect(setAt({}, ["map", "choice"], "Stage01")).toEqual({ map: { choice: "Stage01" } });
    expect(setAt({ a: 1, b: 2 }, ["a"], undefined)).toEqual({ b: 2 });
    expect(getAt(setAt(document, ["rig", "sensors", 0], undefined), ["rig", "sensors"])).toEqual([{ id: "B" }]);
  });
});
