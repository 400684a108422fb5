import type { Color, Material } from "three";

/**
 * Materials of one view, which stay as long as it does. Were the last one that uses a shader disposed
 * of, three.js would throw the shader away, and compile it anew for the next picture: a second for
 * each step of a drag where there is no graphics card.
 */
export class Materials {
  private readonly kept = new Map<string, Material>();

  /** The one that was made for this use and colour before, or a new one. */
  take<T extends Material>(use: string, color: Color, make: () => T): T {
    const key = `${use} ${color.getHexString()}`;
    const known = this.kept.get(key) as T | undefined;
    if (known) return known;
    const made = make();
    this.kept.set(key, made);
    return made;
  }

  dispose(): void {
    for (const material of this.kept.values()) material.dispose();
    this.kept.clear();
  }
}
