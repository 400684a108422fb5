import { useEffect, useState } from "react";
import { get, sentence } from "./client";

export interface Answer<T> {
  data: T | null;
  error: string | null;
  loading: boolean;
}

/** The answer to a GET; asked anew when the path or `version` changes, the old one shown meanwhile. */
export function useAnswer<T>(path: string | null, version: unknown = 0): Answer<T> {
  const [answer, setAnswer] = useState<Answer<T> & { path: string | null }>({
    data: null,
    error: null,
    loading: path !== null,
    path,
  });
  useEffect(() => {
    if (path === null) return;
    const stop = new AbortController();
    get<T>(path, stop.signal).then(
      (data) => setAnswer({ data, error: null, loading: false, path }),
      (error: unknown) => {
        if (!stop.signal.aborted) setAnswer({ data: null, error: sentence(error), loading: false, path });
      },
    );
    return () => stop.abort();
  }, [path, version]);
  return answer.path === path ? answer : { data: null, error: null, loading: path !== null };
}
