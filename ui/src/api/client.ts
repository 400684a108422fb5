import type { ErrorMessage } from "./types";

/** An answer that is no success, as the server words it. */
export class ApiError extends Error {
  constructor(
    readonly status: number,
    readonly answer: ErrorMessage,
  ) {
    super([answer.message, answer.hint].filter(Boolean).join(" "));
  }
}

/** The server cannot be reached. */
export class OfflineError extends Error {}

async function send(path: string, init?: RequestInit): Promise<Response> {
  let response: Response;
  try {
    // Relative, so that the page works below any path of a proxy.
    response = await fetch(`api${path}`, { credentials: "same-origin", ...init });
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    throw new OfflineError("The server does not answer.");
  }
  if (response.ok) return response;
  let answer: ErrorMessage;
  try {
    answer = (await response.json()) as ErrorMessage;
  } catch {
    answer = { code: "error", message: `The server answered ${response.status}.`, hint: "", errors: [] };
  }
  throw new ApiError(response.status, answer);
}

export async function get<T>(path: string, signal?: AbortSignal): Promise<T> {
  return (await (await send(path, { signal })).json()) as T;
}

export async function getFloats(path: string, signal?: AbortSignal): Promise<Float32Array> {
  return new Float32Array(await (await send(path, { signal })).arrayBuffer());
}

function withBody(method: string, body: unknown, signal?: AbortSignal): RequestInit {
  return {
    method,
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body ?? {}),
    signal,
  };
}

export async function post<T>(path: string, body?: unknown, signal?: AbortSignal): Promise<T> {
  return (await (await send(path, withBody("POST", body, signal))).json()) as T;
}

/** A file; null while the server prepares what it needs for it (202). */
export async function postForBlob(path: string, body: unknown, signal?: AbortSignal): Promise<Blob | null> {
  const response = await send(path, withBody("POST", body, signal));
  return response.status === 202 ? null : response.blob();
}

export async function put<T>(path: string, body: unknown): Promise<T> {
  return (await (await send(path, withBody("PUT", body))).json()) as T;
}

/** A sentence for the user about anything that was thrown. */
export function sentence(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

export async function patch<T>(path: string, body: unknown): Promise<T> {
  return (await (await send(path, withBody("PATCH", body))).json()) as T;
}

/** Remove something; the answer, if there is one. */
export async function remove<T>(path: string): Promise<T | null> {
  const response = await send(path, { method: "DELETE" });
  return response.status === 204 ? null : ((await response.json()) as T);
}
