import { BufferAttribute, BufferGeometry, Color, DoubleSide, Group, Mesh, MeshLambertMaterial } from "three";
import type { VehicleShape } from "../rig/mounts";
import type { Materials } from "./Materials";
import { cssColour } from "./sceneView";

const FIXED: Record<string, number> = {
  glass: 0x18222e,
  rubber: 0x1a1a1c,
  plastic_dark: 0x2a2c30,
  rim: 0xa9aeb4,
  metal: 0x8d9399,
  head_lamp: 0xe6ecf2,
  reverse_lamp: 0xdddddd,
  tail_lamp: 0xa01c20,
  blinker_left: 0xce7418,
  blinker_right: 0xce7418,
  licence_plate: 0xe0e0da,
  sign_red: 0xb0161c,
  sign_white: 0xe6e8e8,
};

/** The vehicle as triangles, in three.js's axes. Its paint follows the page's theme. */
export function carModel(materials: Materials, shape: VehicleShape): Group {
  const group = new Group();
  for (const { material, corners } of shape.parts) {
    const positions = new Float32Array(corners);
    for (let i = 1; i < positions.length; i += 3) positions[i] = -(positions[i] ?? 0);
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(positions, 3));
    geometry.computeVertexNormals();
    const fixed = FIXED[material];
    const colour = fixed === undefined ? cssColour("--car-paint") : new Color(fixed);
    // Mirroring y turned every triangle around; both sides are drawn, so that it does not matter.
    const surface = () => new MeshLambertMaterial({ color: colour, side: DoubleSide });
    group.add(new Mesh(geometry, materials.take("car", colour, surface)));
  }
  return group;
}
