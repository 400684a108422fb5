"""Machine code for rays, compiled by a process of its own while the server makes its town.

To cast rays and to shade what they meet takes the compiler as long as all other kernels and a town
together. On an empty cache the process begins with the server, on another core; the server then
finds the code in the cache.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import TracebackType

from carstage_sim.kernels import do_without_scipy, kernel_cache, kernel_package
from carstage_sim.mesh import TriangleMesh

logger = logging.getLogger(__name__)

COMPILING_LOG = "carstage_sim.compiling"
_RENDER = Path(__file__).parent / "render"
_KERNELS = ("share_shade_packets", "share_cast_rays", "share_cast_packets")
_LIMIT_S = 600.0


class PicturesCompiled:
    """Compiles what shades pictures, unless that was done before; a context manager.

    The process ends with the block, or with the server.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> PicturesCompiled:
        if _is_compiled() or len(os.sched_getaffinity(0)) < 2:
            return self
        logger.info("compiling what draws pictures, once for this version and processor")
        self._began_s = time.monotonic()
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
        )
        return self

    def __exit__(
        self,
        _type: type[BaseException] | None,
        _value: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        process, self._process = self._process, None
        if process is not None:
            with process:  # which closes the pipe
                process.kill()

    def wait(self) -> None:
        """Wait until it is done; what it could not do, the server does itself."""
        if self._process is None:
            return
        try:
            status = self._process.wait(_LIMIT_S)
        except subprocess.TimeoutExpired:
            logger.warning("compiling takes longer than %.0f s: the server compiles", _LIMIT_S)
            return
        if status:
            logger.warning("the process that compiles ended with %d: the server compiles", status)
        else:
            logger.info("compiled in %.0f s", time.monotonic() - self._began_s)


def _is_compiled() -> bool:
    folder = kernel_cache(kernel_package(_RENDER / "shading.py"))
    return all(any(folder.glob(f"*/*.{name}-*.nbi")) for name in _KERNELS)


def main() -> None:
    """Compile the kernels into the cache."""
    threading.Thread(target=_end_with_server, daemon=True).start()
    do_without_scipy()
    from carstage_sim.render.caster import RayCaster
    from carstage_sim.render.picture import PictureMaker
    from carstage_sim.render.scene import SceneStore

    def no_mesh(key: str) -> TriangleMesh:
        raise KeyError(key)

    caster = RayCaster(1)
    PictureMaker(caster).warm_up_rays(SceneStore(None, no_mesh, cache=None))
    caster.close()


def _end_with_server() -> None:
    # Not through sys.stdin, whose lock must be free when the interpreter ends.
    os.read(0, 1)
    os._exit(1)


if __name__ == "__main__":
    main()
