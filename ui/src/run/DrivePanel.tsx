import { useEffect, useState } from "react";
import { live, sendDrive } from "../api/live";
import type { DrivenAtPage, RunSummary } from "../api/types";
import { useStore } from "../state/store";
import { bars, chosenPad, keyName, Presses, readPad, type Pressed } from "./device";
import { ImageThumb } from "./Thumbnails";

const SEND_EVERY_MS = 33;
const NOTHING: Pressed = { held: [], presses: {}, axes: [] };

/** Drives the ego of a run: shows what its camera sees, and sends what is pressed. */
export function DrivePanel({ run, driven }: { run: RunSummary; driven: DrivenAtPage }) {
  const [drives, setDrives] = useState(false);
  const { pressed, device, lost } = useDevice(run.run_id, driven, drives);
  const channel = useStore(live, (now) => now.channels).find((one) => one.sensor_id === driven.camera);
  return (
    <section className="panel drive" aria-label="Drive" data-drives={drives}>
      <div className="drive-picture">
        {channel ? <ImageThumb channel={channel} /> : <p className="empty">The camera appears with the first recorded frame.</p>}
      </div>
      <div className="drive-tools">
        <button type="button" className={drives ? "button danger" : "button primary"} onClick={() => setDrives(!drives)}>
          {drives ? "Stop driving" : "Drive"}
        </button>
        <p role="status">{words(drives, driven, device, lost)}</p>
        {drives &&
          bars(driven, pressed).map(({ name, value, signed }) => (
            <label key={name} className="drive-bar">
              {name}
              <meter min={signed ? -1 : 0} max={1} value={value} aria-label={name} />
            </label>
          ))}
        <p className="muted">{HELP[driven.device]}</p>
      </div>
    </section>
  );
}

const HELP: Record<DrivenAtPage["device"], string> = {
  keyboard: "W or ↑ throttle, S or ↓ brake, A and D or ← and → steer, Q backwards, space hand brake.",
  gamepad: "Left stick steers, right trigger throttle, left trigger brake, B backwards, A hand brake.",
  wheel: "Axes and buttons are those of the configuration.",
};

function words(drives: boolean, driven: DrivenAtPage, device: string, lost: boolean): string {
  if (!drives) return "The car waits, then brakes, until you drive.";
  if (lost) return "The connection is gone: the car brakes.";
  if (device === "") return `No ${driven.device} is seen yet: press one of its buttons.`;
  return `You drive: ${device}`;
}

interface Device {
  pressed: Pressed;
  device: string;
  lost: boolean;
}

/** Reads the device and sends it, as long as somebody drives and sees the page. */
function useDevice(run: string, driven: DrivenAtPage, drives: boolean): Device {
  const [shown, setShown] = useState<Device>({ pressed: NOTHING, device: "", lost: false });
  const kind = driven.device;
  useEffect(() => {
    if (!drives) return;
    const presses = new Presses();
    const sender = Array.from(crypto.getRandomValues(new Uint8Array(8)), (byte) => byte.toString(16).padStart(2, "0")).join("");
    let sequence = 0;
    const send = () => {
      // While nobody sees the page, nothing is sent, and the car brakes.
      if (document.visibilityState !== "visible") return;
      const now = read(kind, presses);
      if (now === null) {
        setShown({ pressed: NOTHING, device: "", lost: false });
        return;
      }
      const sent = sendDrive({ type: "drive", run_id: run, sender, sequence, ...now.pressed });
      sequence += 1;
      setShown({ ...now, lost: !sent });
    };
    const onKey = (event: KeyboardEvent) => {
      const name = kind === "keyboard" ? keyName(event.code) : null;
      if (name === null || event.ctrlKey || event.altKey || event.metaKey || isTyping(event.target)) return;
      event.preventDefault();
      presses.set(name, event.type === "keydown");
      send();
    };
    const onBlur = () => presses.release();
    window.addEventListener("keydown", onKey);
    window.addEventListener("keyup", onKey);
    window.addEventListener("blur", onBlur);
    const timer = window.setInterval(send, SEND_EVERY_MS);
    send();
    return () => {
      window.clearInterval(timer);
      window.removeEventListener("keydown", onKey);
      window.removeEventListener("keyup", onKey);
      window.removeEventListener("blur", onBlur);
    };
  }, [run, kind, drives]);
  return shown;
}

/** Whether keys are meant for a field, such as the run's new name. */
function isTyping(target: EventTarget | null): boolean {
  return target instanceof HTMLElement && target.closest("input, textarea, select") !== null;
}

function read(kind: DrivenAtPage["device"], presses: Presses): { pressed: Pressed; device: string } | null {
  if (kind === "keyboard") return { pressed: { held: presses.held, presses: presses.presses, axes: [] }, device: "keyboard" };
  const pad = chosenPad(navigator.getGamepads());
  return pad && { pressed: readPad(pad, presses), device: pad.id };
}
