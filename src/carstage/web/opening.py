"""Opens the page in the user's browser, without telling the token to anybody else."""

from __future__ import annotations

import html
import os
import tempfile
import webbrowser
from pathlib import Path


def open_in_browser(url: str) -> Path:
    """Have the default browser open an address that holds a token.

    Every user of the machine can read the arguments of a browser's process. So it is given a file
    that its owner alone can read, and that sends it on.

    Args:
        url: the address.

    Returns:
        The file; the system's temporary folder keeps it.
    """
    descriptor, name = tempfile.mkstemp(prefix="carstage-gui-", suffix=".html")
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        target = html.escape(url, quote=True)
        file.write(
            '<!doctype html><meta charset="utf-8"><title>Car-STAGE</title>'
            f'<meta http-equiv="refresh" content="0; url={target}">'
            f'<a href="{target}">Open Car-STAGE</a>\n'
        )
    path = Path(name)
    webbrowser.open(path.as_uri())
    return path
