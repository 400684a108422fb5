import { useEffect, useMemo, useRef } from "react";
import { blindShare, groundCoverage } from "./coverage";
import { kindOf, kindTable, type Modality } from "./kinds";
import { toScreen, type Screen } from "./plane";
import { useRig } from "./useRig";
import { percent } from "../ui/format";

export type CoverageChoice = "off" | "all" | Modality;

const HALF_M = 36;
const CELLS = 216;
const NEAR_M = 10;
/** Opacity by how many sensors see a place, from one on. */
const ALPHA = [60, 105, 140, 165, 180];

/** Which places of the ground are seen by how many sensors, as a picture below the top view. */
export function CoverageLayer({ screen, choice }: { screen: Screen; choice: CoverageChoice }) {
  const rig = useRig();
  const canvas = useRef<HTMLCanvasElement>(null);
  const counts = useMemo(() => {
    const eyes = rig.sensors.flatMap((sensor) => {
      const modality = kindOf(sensor.kind)?.modality;
      const counts = choice === "all" ? modality !== "truth" : modality === choice;
      const view = sensor.onEgo && counts ? rig.view(sensor) : null;
      return view ? [{ sensor, view }] : [];
    });
    return groundCoverage(eyes, rig.shape?.box ?? null, HALF_M, CELLS);
  }, [rig, choice]);
  const colour = kindTable.get().modalities.find(({ name }) => name === choice)?.colour ?? "accent";
  useEffect(() => {
    const context = canvas.current?.getContext("2d");
    if (!context) return;
    const style = getComputedStyle(document.documentElement);
    const seen = channels(style.getPropertyValue(`--${choice === "all" ? "accent" : colour}-rgb`));
    const blind = channels(style.getPropertyValue("--bad-rgb"));
    const image = context.createImageData(CELLS, CELLS);
    counts.forEach((count, i) => {
      // Blind places are hatched: colour alone is not enough for everybody.
      const hatch = (Math.floor(i / CELLS) + (i % CELLS)) % 4 < 2 ? 74 : 30;
      const [r, g, b] = count === 0 ? blind : seen;
      image.data.set([r, g, b, count === 0 ? hatch : (ALPHA[Math.min(count, ALPHA.length) - 1] ?? 60)], i * 4);
    });
    context.putImageData(image, 0, 0);
  }, [counts, choice, colour]);
  const [left, top] = toScreen(screen, [-HALF_M, HALF_M]);
  const size = 2 * HALF_M * screen.scale;
  const blind = blindShare(counts, rig.shape?.box ?? null, HALF_M, CELLS, NEAR_M);
  return (
    <>
      <canvas
        ref={canvas}
        className="coverage"
        width={CELLS}
        height={CELLS}
        style={{ left, top, width: size, height: size }}
        aria-hidden="true"
      />
      <p className="coverage-key">
        <span className="key key-blind" /> seen by none
        <span className="key key-one" /> one
        <span className="key key-more" /> several
        <span className="coverage-share">
          blind within {NEAR_M} m: <b>{percent(blind)}</b>
        </span>
      </p>
    </>
  );
}

function channels(text: string): [number, number, number] {
  const [r = 128, g = 128, b = 128] = text.split(",").map(Number);
  return [r, g, b];
}
