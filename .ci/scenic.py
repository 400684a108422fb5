"""Make the environment that Scenic's tests run in: `CACHE/scenic-env`.

Scenic brings `opencv-python` and `pygame-ce`, which own the modules of our `opencv-python-headless`
and `pygame`. So it never shares an environment with Car-STAGE. It always ends with 0: tests skip
with the reason where the environment is missing.
"""

import shutil
import subprocess
import sys

from carstage_sim.cache import cache_folder

PACKAGES = ("scenic==3.1.1", "carla==0.9.16")


def main() -> int:
    folder = cache_folder() / "scenic-env"
    python = folder / "bin" / "python"
    try:
        subprocess.run([str(python), "-c", "import scenic, carla"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        uv = shutil.which("uv") or "uv"
        folder.parent.mkdir(parents=True, exist_ok=True)
        try:
            # Run there: uv heeds the pins of a project that it is called in.
            for words in (
                [
                    "venv",
                    "--quiet",
                    "--no-project",
                    "--clear",
                    "--python",
                    sys.executable,
                    str(folder),
                ],
                ["pip", "install", "--quiet", "--python", str(python), *PACKAGES],
            ):
                subprocess.run([uv, *words], check=True, cwd=folder.parent)
        except (OSError, subprocess.CalledProcessError) as error:
            print(f"Scenic: not tested here: {error}", flush=True)
            return 0
    print(f"{' '.join(PACKAGES)}: ready in {folder}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
