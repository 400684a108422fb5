import { useEffect, useRef, useState } from "react";
import { post, postForBlob, sentence } from "../api/client";
import { isEmbedded } from "../configure/serverFacts";
import { Icon } from "../ui/Icon";
import type { RigSensor } from "./sensors";
import { useRig } from "./useRig";

const SILENCE_MS = 120;
/** While a button is down: a hand that rests is shown what it would leave. */
const HELD_SILENCE_MS = 500;
const STARTING_MS = 900;
const BUSY_MS = 150;

/** A live picture through a sensor, asked anew whenever it is moved. */
export function SensorPreview({ sensor }: { sensor: RigSensor }) {
  const rig = useRig();
  const [on, setOn] = useState(false);
  const [picture, setPicture] = useState<string | null>(null);
  const [state, setState] = useState("");
  const { map, weather, ego, server, image_size } = rig.document;
  const wanted = JSON.stringify([sensor.given, map, weather, ego, server, image_size]);
  const shown = useRef<string | null>(null);
  const body = useRef({ config: rig.document, sensor: sensor.given });
  body.current = { config: rig.document, sensor: sensor.given };

  const held = useHeldButton();

  useEffect(() => {
    if (!on) return;
    const stop = new AbortController();
    const later = (ms?: number) => window.setTimeout(() => void ask(), ms);
    let timer = later(held.current ? HELD_SILENCE_MS : SILENCE_MS);
    let asking = false;
    const letGo = () => {
      if (asking) return;
      window.clearTimeout(timer);
      timer = later();
    };
    if (held.current) window.addEventListener("pointerup", letGo, { signal: stop.signal, once: true });
    async function ask() {
      asking = true;
      setState((now) => now || "drawing…");
      try {
        const blob = await postForBlob("/preview", { ...body.current, width: 640 }, stop.signal);
        if (blob === null) {
          const first = shown.current === null;
          if (first) setState(isEmbedded(body.current.config) ? "starting the simulator…" : "waiting for the server…");
          timer = later(first ? STARTING_MS : BUSY_MS);
          return;
        }
        if (shown.current) URL.revokeObjectURL(shown.current);
        shown.current = URL.createObjectURL(blob);
        setPicture(shown.current);
        setState("");
      } catch (error) {
        if (stop.signal.aborted) return;
        setState(sentence(error));
      }
    }
    return () => {
      stop.abort();
      window.clearTimeout(timer);
    };
  }, [on, wanted, held]);

  useEffect(
    () => () => {
      if (shown.current) URL.revokeObjectURL(shown.current);
    },
    [],
  );

  if (!on)
    return (
      <button
        type="button"
        className="button wide"
        onClick={() => {
          setOn(true);
          post("/preview/warm", { server: rig.document.server ?? {} }).catch((error: unknown) => setState(sentence(error)));
        }}
      >
        <Icon name="eye" /> Preview through this sensor
      </button>
    );
  return (
    <figure className="sensor-preview" aria-busy={state !== ""}>
      {picture ? <img src={picture} alt={`View through ${sensor.id}`} /> : <div className="preview-blank" />}
      <figcaption>
        <span role="status">{state || "live: follows every change"}</span>
        <button type="button" className="button small" onClick={() => setOn(false)}>
          Close
        </button>
      </figcaption>
    </figure>
  );
}

/** Whether a button of the mouse, a finger or a pen is down. */
function useHeldButton() {
  const held = useRef(false);
  useEffect(() => {
    const stop = new AbortController();
    const options = { capture: true, signal: stop.signal };
    window.addEventListener("pointerdown", () => (held.current = true), options);
    for (const end of ["pointerup", "pointercancel"] as const)
      window.addEventListener(end, () => (held.current = false), options);
    return () => stop.abort();
  }, []);
  return held;
}
