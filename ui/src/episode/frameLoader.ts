import { get, getFloats, sentence } from "../api/client";
import type { FrameMessage } from "../api/types";

/** What of a frame the page shows. */
export interface Wanted {
  pictures: readonly { sensor: string; width: number; mask: boolean }[];
  points: { sensor: string; sweeps: number } | null;
}

export interface ShownPicture {
  url: string;
  mask: string | null;
}

/** A frame with all that is shown of it: whoever draws it draws one frame. */
export interface Bundle {
  k: number;
  frame: FrameMessage;
  pictures: ReadonlyMap<string, ShownPicture>;
  points: Float32Array | null;
  /** Why there are no points. */
  pointsNote: string;
}

/** Frames whose pictures are kept decoded: a hand that goes to and fro finds them again. */
const MOST_KEPT = 64;
/** Points are large; of a few frames with very many, fewer are kept. */
const MOST_POINT_BYTES = 256_000_000;

/** Loads frames of one episode, keeps the last few, and knows which are on their way. */
export class FrameLoader {
  private readonly kept = new Map<string, Promise<Bundle>>();
  private readonly pointBytes = new Map<string, number>();
  /** Decoded pictures live as long as something refers to them. */
  private readonly images = new Map<string, Promise<HTMLImageElement>>();

  constructor(private readonly base: string) {}

  load(k: number, wanted: Wanted): Promise<Bundle> {
    const key = `${k} ${JSON.stringify(wanted)}`;
    const known = this.kept.get(key);
    if (known) {
      this.kept.delete(key); // the newest used is the last to go
      this.kept.set(key, known);
      return known;
    }
    const asked = this.ask(k, wanted);
    this.kept.set(key, asked);
    asked.then(
      ({ points }) => {
        if (this.kept.get(key) !== asked) return; // it has gone meanwhile
        this.pointBytes.set(key, points?.byteLength ?? 0);
        this.trim(wanted);
      },
      () => this.kept.delete(key),
    );
    this.trim(wanted);
    return asked;
  }

  /** Let go of what was used longest ago. */
  private trim(wanted: Wanted): void {
    let bytes = 0;
    for (const one of this.pointBytes.values()) bytes += one;
    for (const old of this.kept.keys()) {
      if (this.kept.size <= 1 || (this.kept.size <= MOST_KEPT && bytes <= MOST_POINT_BYTES)) break;
      bytes -= this.pointBytes.get(old) ?? 0;
      this.kept.delete(old);
      this.pointBytes.delete(old);
    }
    const pictures = MOST_KEPT * 2 * Math.max(1, wanted.pictures.length);
    for (const old of this.images.keys()) {
      if (this.images.size <= pictures) break;
      this.images.delete(old);
    }
  }

  private async ask(k: number, wanted: Wanted): Promise<Bundle> {
    const { base } = this;
    // All at once: what a frame lacks is refused, and shown as missing.
    const frame = get<FrameMessage>(`${base}/frames/${k}`);
    const points = wanted.points ? this.points(k, wanted.points) : { points: null, pointsNote: "" };
    const pictures = await this.pictures(k, wanted, await frame);
    return { k, frame: await frame, pictures, ...(await points) };
  }

  private async pictures(k: number, wanted: Wanted, frame: FrameMessage): Promise<Map<string, ShownPicture>> {
    const shown = new Map<string, ShownPicture>();
    await Promise.all(
      wanted.pictures.map(async ({ sensor, width, mask }) => {
        if (!frame.available.includes(sensor)) return;
        const picture = {
          url: `api${this.base}/sensors/${sensor}/${k}.png?width=${width}`,
          mask: mask ? `api${this.base}/masks/${sensor}/${k}.png` : null,
        };
        try {
          await Promise.all([this.decoded(picture.url), picture.mask ? this.decoded(picture.mask) : null]);
          shown.set(sensor, picture);
        } catch (error) {
          console.info("a picture could not be read", picture.url, error);
        }
      }),
    );
    return shown;
  }

  private async points(k: number, { sensor, sweeps }: NonNullable<Wanted["points"]>): Promise<Pick<Bundle, "points" | "pointsNote">> {
    try {
      const query = sweeps > 1 ? `?sweeps=${sweeps}` : "";
      return { points: await getFloats(`${this.base}/points/${sensor}/${k}${query}`), pointsNote: "" };
    } catch (error) {
      return { points: null, pointsNote: sentence(error) };
    }
  }

  private decoded(url: string): Promise<HTMLImageElement> {
    const known = this.images.get(url);
    if (known) return known;
    const image = new Image();
    image.src = url;
    const asked = image.decode().then(() => image);
    this.images.set(url, asked);
    asked.catch(() => this.images.delete(url));
    return asked;
  }
}
