"""Where a dataset is: a folder on this machine, or a place in an object store, by its address."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import unquote, urlsplit

from carstage.errors import BadInputError
from carstage.files.home import without_tilde
from carstage.storage.remote_path import RemotePath

#: A path that went through ``Path`` has one slash left of the two.
_ADDRESS = re.compile(r"(?P<scheme>[A-Za-z][A-Za-z0-9+.-]+):/{1,3}")
_THIS_MACHINE = ("", "localhost")
_BUCKET = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{1,254}")
#: Addresses of object stores, by what users write.
_STORES = {"s3": "s3", "s3a": "s3", "gs": "gs", "gcs": "gs", "az": "az", "azure": "az"}
_INSTEAD = {
    **dict.fromkeys(("sftp", "scp", "ssh"), "Mount it (sshfs) and name the folder"),
    **dict.fromkeys(("ftp", "ftps"), "Mount it and name the folder"),
    **dict.fromkeys(("http", "https", "webdav"), "Name the bucket, as s3://BUCKET/PREFIX"),
    "hdfs": "Use its S3 gateway, as s3://BUCKET/PREFIX",
}


def dataset_root(address: str | Path | RemotePath) -> Path | RemotePath:
    """The folder, or the place in an object store, that an address names.

    Args:
        address: a path, ``file:///PATH``, ``s3://BUCKET/PREFIX``, ``gs://BUCKET/PREFIX`` or
            ``az://CONTAINER/PREFIX``.

    Raises:
        BadInputError: the address is of another kind of store or of another machine, names no
            bucket, or holds what belongs into the environment.
    """
    if isinstance(address, RemotePath):
        return address
    text = str(address)
    found = _ADDRESS.match(text)
    if found is None:
        return without_tilde(address)
    scheme, rest = found["scheme"].lower(), text[found.end() :]
    if scheme in _STORES:
        return _remote(_STORES[scheme], rest)
    if scheme == "file":
        return _file(text)
    instead = _INSTEAD.get(scheme, "Name a folder, or s3://, gs:// or az:// and a bucket")
    raise BadInputError(
        f"{scheme}://{_without_secrets(rest)}: datasets cannot be at {scheme}:// addresses.",
        f"{instead}. To name a local folder that is called so, write ./{scheme}:….",
    )


def local_folder(address: str | Path) -> Path:
    """The folder on this machine that an address names.

    Raises:
        BadInputError: the address is that of an object store, or :func:`dataset_root` refuses it.
    """
    root = dataset_root(address)
    if isinstance(root, RemotePath):
        raise BadInputError(
            f"{root}: this has to be a folder on this machine.", "Name a folder by its path."
        )
    return root


def _remote(scheme: str, rest: str) -> RemotePath:
    where, _, prefix = rest.partition("/")
    if "@" in where or "?" in rest or "#" in rest:
        raise BadInputError(
            f"{scheme}://{_without_secrets(rest)}: an address holds a bucket and a path alone.",
            "Give credentials and options by the environment, as the provider's own tools do.",
        )
    if not _BUCKET.fullmatch(where):
        raise BadInputError(
            f"{scheme}://{rest}: {where!r} is no name of a bucket.",
            f"Write {scheme}://BUCKET/PREFIX.",
        )
    parts = [part for part in prefix.split("/") if part]
    if any(part in (".", "..") or not part.isprintable() for part in parts):
        raise BadInputError(
            f"{scheme}://{rest!r}: the path has a part that is no name.",
            "Use letters, digits, '_', '.' and '-'.",
        )
    return RemotePath("/".join((f"{scheme}://{where}", *parts)))


def _file(text: str) -> Path:
    parts = urlsplit(text)
    if parts.netloc not in _THIS_MACHINE:
        raise BadInputError(
            f"{text}: {parts.netloc!r} is another machine.", "Write file:///PATH, or the path."
        )
    return Path(unquote(parts.path))


def _without_secrets(rest: str) -> str:
    """What follows the scheme, without a user's name and password, and without a query."""
    where, slash, path = rest.partition("/")
    return where.rpartition("@")[2] + slash + re.split("[?#]", path)[0]
