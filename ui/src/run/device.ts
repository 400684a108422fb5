import type { DriveMessage, DrivenAtPage } from "../api/types";

/** What is pressed, as a message has it. */
export type Pressed = Pick<DriveMessage, "held" | "presses" | "axes">;

/** SDL's names of the keys that drive, by the browser's codes: places on the keyboard. */
const KEYS: Record<string, string> = {
  ArrowUp: "up", ArrowDown: "down", ArrowLeft: "left", ArrowRight: "right", Space: "space", Comma: ",", Period: ".",
  KeyW: "w", KeyA: "a", KeyS: "s", KeyD: "d", KeyQ: "q", KeyM: "m",
};
const MOST_BUTTONS = 40;
const MOST_AXES = 16;
const LEFT_TRIGGER = 6;
const RIGHT_TRIGGER = 7;

export function keyName(code: string): string | null {
  return KEYS[code] ?? null;
}

/** Keys or buttons that are down, and how often each went down. */
export class Presses {
  private readonly down = new Set<string>();
  private readonly counts = new Map<string, number>();

  set(name: string, down: boolean): void {
    if (down && !this.down.has(name)) this.counts.set(name, (this.counts.get(name) ?? 0) + 1);
    if (down) this.down.add(name);
    else this.down.delete(name);
  }

  /** Nothing is down any more: the page has lost the keyboard. */
  release(): void {
    this.down.clear();
  }

  get held(): string[] {
    return [...this.down].sort();
  }

  get presses(): Record<string, number> {
    return Object.fromEntries(this.counts);
  }
}

/**
 * Axes with the numbers of SDL. A pad of the standard layout has its triggers among the buttons;
 * SDL has them as axes 2 and 5, from -1 (let go) to 1. Others are as the browser has them.
 */
export function axesOf(pad: Pick<Gamepad, "mapping" | "axes" | "buttons">): number[] {
  const axes = pad.axes.map(within);
  if (pad.mapping !== "standard") return axes.slice(0, MOST_AXES);
  const trigger = (button: number) => within(2 * (pad.buttons[button]?.value ?? 0) - 1);
  const [x = 0, y = 0, x2 = 0, y2 = 0] = axes;
  return [x, y, trigger(LEFT_TRIGGER), x2, y2, trigger(RIGHT_TRIGGER)];
}

function within(value: number): number {
  return Number.isFinite(value) ? Math.min(1, Math.max(-1, value)) : 0;
}

export function readPad(pad: Pick<Gamepad, "mapping" | "axes" | "buttons">, presses: Presses): Pressed {
  pad.buttons.slice(0, MOST_BUTTONS).forEach((button, number) => presses.set(`button${number}`, button.pressed));
  return { held: presses.held, presses: presses.presses, axes: axesOf(pad) };
}

/** The pad that a person uses: the one of which something was pressed last, else the first. */
export function chosenPad(pads: readonly (Gamepad | null)[]): Gamepad | null {
  const there = pads.filter((pad): pad is Gamepad => pad?.connected ?? false);
  return there.reduce<Gamepad | null>((best, pad) => (best === null || pad.timestamp > best.timestamp ? pad : best), null);
}

/** What is shown of a device: a bar for each thing that it steers, from -1 to 1 or from 0 to 1. */
export function bars(driven: DrivenAtPage, pressed: Pressed): { name: string; value: number; signed: boolean }[] {
  const held = new Set(pressed.held);
  if (driven.device === "keyboard") {
    const any = (...names: string[]) => names.some((name) => held.has(name));
    return [
      { name: "Steering", value: Number(any("d", "right")) - Number(any("a", "left")), signed: true },
      { name: "Throttle", value: Number(any("w", "up")), signed: false },
      { name: "Brake", value: Number(any("s", "down")), signed: false },
    ];
  }
  const axis = (name: string) => pressed.axes[driven.inputs[name] ?? -1];
  const pedal = (name: string) => {
    const value = axis(name) ?? 0;
    return driven.device === "wheel" ? (1 - value) / 2 : (value + 1) / 2;
  };
  return [
    { name: "Steering", value: axis("steer_axis") ?? 0, signed: true },
    { name: "Throttle", value: pedal("throttle_axis"), signed: false },
    { name: "Brake", value: pedal("brake_axis"), signed: false },
  ];
}
