const RIDERS = 2 ** 32;
const LEVEL = 2 ** 52;

/** A track's id as people can say it: riders and objects of the level have ids that are very long. */
export function trackText(track: number): string {
  if (track >= LEVEL) return `L${track - LEVEL}`;
  if (track >= RIDERS) return `${track - RIDERS} rider`;
  return String(track);
}
