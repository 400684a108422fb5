import { useCallback, useEffect, useRef, useState, type PointerEvent, type RefObject } from "react";
import { fit, fromScreen, toScreen, type Camera, type Screen } from "./plane";
import type { Point } from "./outline";

/** Pixels per metre that a car is looked at with: the least when fitted, the least and the most by zooming. */
const CAR: Scales = { fitted: 0.5, least: 1, most: 600 };

interface Scales {
  fitted: number;
  least: number;
  most: number;
}

interface Pan {
  pointer: number;
  from: Point;
  camera: Camera;
}

/** Zoom by wheel, pan by dragging the ground; fits `low`..`high` until the user moves it. */
export function usePlaneCamera(
  element: RefObject<SVGSVGElement | null>,
  size: { width: number; height: number },
  low: Point,
  high: Point,
  scales = CAR,
) {
  const [own, setOwn] = useState<Camera | null>(null);
  const pan = useRef<Pan | null>(null);
  const fitted = fit(low, high, Math.max(size.width, 50), Math.max(size.height, 50), scales.fitted);
  const camera = own ?? fitted;
  const screen: Screen = { ...camera, ...size };
  const current = useRef(screen);
  current.current = screen;

  const zoom = useCallback((factor: number, at?: Point) => {
    const now = current.current;
    const place: Point = at ?? [now.width / 2, now.height / 2];
    const [u, v] = fromScreen(now, place);
    const scale = Math.min(scales.most, Math.max(scales.least, now.scale * factor));
    const ratio = now.scale / scale;
    setOwn({
      scale,
      center: [u + (now.center[0] - u) * ratio, v + (now.center[1] - v) * ratio],
    });
  }, [scales]);

  useEffect(() => {
    const svg = element.current;
    if (!svg) return;
    const wheel = (event: WheelEvent) => {
      event.preventDefault(); // React listens passively
      const box = svg.getBoundingClientRect();
      zoom(Math.exp(-event.deltaY * 0.0015), [event.clientX - box.left, event.clientY - box.top]);
    };
    svg.addEventListener("wheel", wheel, { passive: false });
    return () => svg.removeEventListener("wheel", wheel);
  }, [element, zoom]);

  const ground = {
    onPointerDown(event: PointerEvent<SVGElement>) {
      if (event.button > 1) return;
      event.currentTarget.setPointerCapture(event.pointerId);
      pan.current = { pointer: event.pointerId, from: [event.clientX, event.clientY], camera };
    },
    onPointerMove(event: PointerEvent<SVGElement>) {
      const start = pan.current;
      if (start?.pointer !== event.pointerId) return;
      const { scale, center } = start.camera;
      setOwn({
        scale,
        center: [
          center[0] - (event.clientX - start.from[0]) / scale,
          center[1] + (event.clientY - start.from[1]) / scale,
        ],
      });
    },
    onPointerUp(event: PointerEvent<SVGElement>) {
      if (pan.current?.pointer === event.pointerId) pan.current = null;
    },
  };
  /** Bring a place into the view, if it is outside or near the edge. */
  const show = useCallback((place: Point) => {
    const now = current.current;
    const [x, y] = toScreen(now, place);
    const edge = Math.min(40, now.width / 4, now.height / 4);
    if (x < edge || y < edge || x > now.width - edge || y > now.height - edge)
      setOwn({ scale: now.scale, center: place });
  }, []);
  return { screen, ground, zoom, show, reset: () => setOwn(null) };
}
