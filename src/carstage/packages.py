"""Versions of installed packages."""

from __future__ import annotations

from importlib.metadata import distribution, version

_KEY = "version:"


def installed_version(name: str) -> str:
    """The version of an installed package, as ``importlib.metadata.version`` gives it.

    That one parses the package's whole description for it: a millisecond for each.

    Args:
        name: as on the package index.

    Raises:
        PackageNotFoundError: it is not installed.
    """
    head = (distribution(name).read_text("METADATA") or "").partition("\n\n")[0]
    for line in head.splitlines():
        if line.lower().startswith(_KEY):
            return line[len(_KEY) :].strip()
    return version(name)  # a record of another form
