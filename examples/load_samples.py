"""Frames for a training loop, from several processes: `python load_samples.py DATASET`."""

import multiprocessing
import sys
from typing import Any

import numpy as np

from carstage.dataset import Dataset, Frame, FrameSamples


def read_sample(frame: Frame) -> dict[str, Any]:
    """A picture and its 2D boxes; a function of a module, so that workers can import it."""
    camera = next(s.id for s in frame.episode.sensors if s.kind == "rgb" and s.calibration.labelled)
    rows = [r for r in frame.camera_objects.get(camera, ()) if r["visible"] and r["bbox_modal"]]
    return {
        "image": frame.read(camera).transpose(2, 0, 1).copy(),  # (3, H, W) uint8, writable
        "boxes": np.array([row["bbox_modal"] for row in rows], np.float32).reshape(-1, 4),
        "classes": [frame.object(row["track_id"])["class"] for row in rows],
    }


def main() -> None:
    """Run the example."""
    source = sys.argv[1]
    cameras = [s.id for s in Dataset(source).episodes[0].sensors if s.kind == "rgb"]
    samples = FrameSamples(source, read_sample, sensors=cameras[:1])
    try:
        from torch.utils.data import DataLoader
    except ImportError:  # any pool will do: the samples are pickled, their files opened there
        with multiprocessing.get_context("spawn").Pool(2) as pool:
            loaded = pool.map(samples.__getitem__, range(len(samples)))
    else:
        # Numbers of boxes differ from picture to picture: keep a batch as a list.
        loader = DataLoader(
            samples, batch_size=4, shuffle=True, num_workers=2, collate_fn=list,
            multiprocessing_context="spawn",
        )  # fmt: skip
        loaded = [sample for batch in loader for sample in batch]
    boxes = sum(len(sample["boxes"]) for sample in loaded)
    print(f"{len(loaded)} samples of {loaded[0]['image'].shape}, {boxes} boxes")


if __name__ == "__main__":
    main()
