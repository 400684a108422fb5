"""Export, and open with nuscenes-devkit: `python open_in_nuscenes.py DATASET OUT`."""

import sys

from nuscenes.nuscenes import NuScenes

from carstage.exporters import export_dataset


def main() -> None:
    """Run the example."""
    source, target = sys.argv[1:]
    export_dataset("nuscenes", source, target)
    nusc = NuScenes("v1.0-carstage", target, verbose=False)
    print(f"{len(nusc.scene)} scenes, {len(nusc.sample)} samples, {len(nusc.instance)} instances")
    sample = nusc.sample[0]
    for channel, token in sample["data"].items():
        path, boxes, _ = nusc.get_sample_data(token)
        print(f"{channel}: {path}, {len(boxes)} boxes")


if __name__ == "__main__":
    main()
