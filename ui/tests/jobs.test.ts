import { createElement } from "react";
import { renderToStaticMarkup } from "react-dom/server";
import { expect, test } from "vitest";
import type { Job } from "../src/api/types";
import { JobProgress } from "../src/datasets/JobProgress";

test("the bar of a job is as long as what is done", () => {
  const job = { job_id: "j", title: "Export", state: "running", phase: "writing", done: 1, total: 4 } as Job;
  expect(renderToStaticMarkup(createElement(JobProgress, { job }))).toContain('style="width:25%"');
});
