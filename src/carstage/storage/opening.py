"""From what the user gives as ``--out`` to the store that it names."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import unquote

from carstage.errors import BadInputError
from carstage.files.home import without_tilde
from carstage.storage.local import LocalStore
from carstage.storage.store import Store


def open_store(out: str | Path) -> Store:
    """The store that a path or URL names.

    Args:
        out: a folder, or a URL; ``file://`` URLs are folders.

    Raises:
        BadInputError: the URL's scheme is of no store that is built in, or a ``file://`` URL names
            another machine.
    """
    text = str(out)
    scheme, separator, rest = text.partition("://")
    if not separator:
        return LocalStore(without_tilde(text))
    if scheme == "file":
        host, slash, path = rest.partition("/")
        if host not in ("", "localhost"):
            raise BadInputError(
                f"output: {text} is on another machine, {host}.", "Write file:///folder."
            )
        return LocalStore(Path(unquote(slash + path)))
    raise BadInputError(
        f"output: no store for {scheme}:// addresses.", "Give a folder on a local disk."
    )
