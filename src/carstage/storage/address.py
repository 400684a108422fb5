"""Where a dataset is: today a folder on this machine, by its path or as ``file://``."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import unquote, urlsplit

from carstage.errors import BadInputError
from carstage.files.home import without_tilde

#: A path that went through ``Path`` has one slash left of the two.
_ADDRESS = re.compile(r"(?P<scheme>[A-Za-z][A-Za-z0-9+.-]+):/{1,3}")
_THIS_MACHINE = ("", "localhost")


def local_folder(address: str | Path) -> Path:
    """The folder that a path or a ``file://`` address names.

    Raises:
        BadInputError: the address is that of another kind of store, or of another machine.
    """
    text = str(address)
    found = _ADDRESS.match(text)
    if found is None:
        return without_tilde(address)
    scheme = found["scheme"].lower()
    if scheme != "file":
        raise BadInputError(
            f"{scheme}://{text[found.end() :]}: datasets cannot be at {scheme}:// yet.",
            "Name a folder on this machine, by its path or as file:///PATH. To name a local folder "
            f"that is called so, write ./{text}.",
        )
    parts = urlsplit(text)
    if parts.netloc not in _THIS_MACHINE:
        raise BadInputError(
            f"{text}: {parts.netloc!r} is another machine.", "Write file:///PATH, or the path."
        )
    return Path(unquote(parts.path))
