"""``PYTHON borrowed.py MODULE ARGUMENTS...``: runs a module of this ``carstage`` in another Python.

Only ``carstage`` itself is lent: what else is installed beside it, for this Python, would come
before the other's own packages. Standard library and Python 3.8, as all that is run this way.
"""

from __future__ import annotations

import runpy
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]


def main() -> None:
    """Import the package from its folder, then run the module as ``python -m`` does."""
    sys.path.pop(0)  # the folder of this file, whose modules are no top-level ones
    module = sys.argv.pop(1)
    spec = spec_from_file_location(
        PACKAGE.name, PACKAGE / "__init__.py", submodule_search_locations=[str(PACKAGE)]
    )
    assert spec is not None
    assert spec.loader is not None
    package = module_from_spec(spec)
    sys.modules[PACKAGE.name] = package
    spec.loader.exec_module(package)
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
