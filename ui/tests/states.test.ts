import { expect, test } from "vitest";
import type { RunSummary } from "../src/api/types";
import { mayHaveDataset } from "../src/run/states";

test("no dataset is offered of a run that ended before it had a folder", () => {
  const run = (alive: RunSummary["alive"], folder: string | null) => ({ alive, folder }) as RunSummary;
  expect(mayHaveDataset(run("ended", null))).toBe(false);
  expect(mayHaveDataset(run("dead", null))).toBe(false);
  expect(mayHaveDataset(run("ended", "/d/runs/r"))).toBe(true);
  expect(mayHaveDataset(run("running", null))).toBe(true);
  expect(mayHaveDataset(run("queued", null))).toBe(true);
});
