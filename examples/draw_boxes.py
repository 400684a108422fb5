"""Draw the labels of the frame with most to see: `python draw_boxes.py DATASET OUT.png`."""

import sys

import numpy as np
from PIL import Image, ImageDraw

from carstage.dataset import Dataset, Frame, decode_mask
from carstage.geometry import EDGES


def most_to_see(dataset: Dataset) -> tuple[Frame, str]:
    """The frame and camera with most visible objects."""
    best = None
    most = -1
    for frame in dataset.iter_frames():  # tables only: no picture is read here
        for camera, rows in frame.camera_objects.items():
            visible = sum(row["visible"] for row in rows)
            if frame.has(camera) and visible > most:
                best, most = (frame, camera), visible
    if best is None:
        sys.exit("The dataset has no labelled camera.")
    return best


def draw(frame: Frame, camera: str) -> Image.Image:
    """The camera's picture: masks tinted, 3D boxes as wires, 2D boxes around what is seen."""
    picture = frame.read(camera).copy()
    visible = [row for row in frame.camera_objects[camera] if row["visible"]]
    for row in visible:
        if row["mask_modal"] is not None:
            mask = decode_mask(row["mask_modal"], *picture.shape[:2])
            picture[mask] = picture[mask] // 2 + np.array([0, 100, 60], np.uint8)
    image = Image.fromarray(picture)
    pen = ImageDraw.Draw(image)
    for row in visible:
        corners = row["corners_uv"]  # px; None behind the camera, and where 3D was not asked for
        for a, b in EDGES:
            if corners and corners[a] and corners[b]:
                pen.line([tuple(corners[a]), tuple(corners[b])], fill=(255, 220, 0))
        if row["bbox_modal"]:
            pen.rectangle(row["bbox_modal"], outline=(255, 255, 255))
        kind, distance = frame.object(row["track_id"])["class"], row["distance"]
        print(f"{kind:14} {distance:5.1f} m  occluded {row['occlusion_ratio'] or 0:4.0%}")
    return image


def main() -> None:
    """Run the example."""
    source, target = sys.argv[1:]
    dataset = Dataset(source)
    frame, camera = most_to_see(dataset)
    print(f"{dataset.name}: episode {frame.episode.id}, frame {frame.k}, {camera}")
    draw(frame, camera).save(target)


if __name__ == "__main__":
    main()
