"""Make the environment of every supported CARLA version's client wheel, as a run would.

`python .ci/wheels.py` fills `CACHE/wheels/VERSION` and prints one line per version: what is there
or why not. It always ends with 0: tests skip with that reason where a wheel is missing. CACHE is
the user's cache folder for Car-STAGE, or what CARSTAGE_CACHE_DIR names.
"""

import sys

from carstage.errors import CarStageError
from carstage.releases import KNOWN
from carstage.server.interpreters import create_client


def main() -> int:
    for release in KNOWN:
        try:
            found = f"ready in {create_client(release).path.parents[1]}"
        except CarStageError as error:
            found = f"not tested here: {error.message}"
        print(f"carla {release}: {found}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
