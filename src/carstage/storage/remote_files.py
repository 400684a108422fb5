"""The objects below one address, by ``obstore`` (extra ``cloud``), with typed errors."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache, partial
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from carstage.errors import BadInputError, RequestGivenUpError, StorageError
from carstage.storage.credentials import aws_profile
from carstage.storage.remote_errors import explain, is_missing_object, is_unsupported
from carstage.storage.remote_path import RemoteStat
from carstage.storage.remote_requests import Requests

if TYPE_CHECKING:
    from obstore.store import ObjectStore

_TIMEOUT_S = 60
_CONNECT_S = 5
_RETRIES = 8
_RETRY_FOR_S = 90
_FIRST_BACKOFF_S, _MOST_BACKOFF_S = 0.1, 8
_TRIES = 6
_PART_BYTES = 8 << 20
"""Larger files go up in parts, several at a time."""
_DELETED_AT_ONCE = 1000
_ENDPOINTS = {
    "s3": ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT"),
    "gs": ("GOOGLE_BASE_URL",),
    "az": ("AZURITE_BLOB_STORAGE_URL", "AZURE_STORAGE_ENDPOINT", "AZURE_ENDPOINT"),
}

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class RemoteObject:
    """One entry of a listing.

    Attributes:
        key: path below the root of the dataset.
        bytes: its size.
        modified_s: when it was written, Unix time of the store's clock.
    """

    key: str
    bytes: int
    modified_s: float


class RemoteFiles:
    """Reads and writes objects; every method waits, and may be called from several threads.

    What fails for the moment (5xx, lost connections, time-outs) is tried again with growing, random
    waits. S3 is given the SHA-256 of what is sent and refuses anything else.

    Args:
        root: address of the dataset, such as ``s3://bucket/prefix``.

    Raises:
        BadInputError: ``obstore`` is not installed.
        StoreAccessError: the environment's settings for the store cannot be understood.
    """

    def __init__(self, root: str) -> None:
        self.root = root
        self.requests = Requests(root)
        """By which it asks; it says how long they are waited for."""
        self._bulk_delete = True
        self.store = self._opened(bulk_delete=True)

    def read(self, key: str) -> bytes:
        """The content of an object.

        Raises:
            FileNotFoundError: there is none.
        """
        import obstore

        return self._ask("reading", lambda: bytes(obstore.get(self.store, key).bytes()), key)

    def read_range(self, key: str, start: int, end: int) -> bytes:
        """The bytes of an object from ``start`` to before ``end``.

        Raises:
            FileNotFoundError: there is none.
        """
        import obstore

        def fetch() -> bytes:
            return bytes(obstore.get_range(self.store, key, start=start, end=end))

        return self._ask("reading", fetch, key)

    def read_into(self, key: str, path: Path, most_bytes: int) -> None:
        """Write the content of an object to a local file, piece by piece.

        Raises:
            FileNotFoundError: there is none.
            OSError: it is larger than ``most_bytes``, or the file cannot be written.
        """
        import errno

        import obstore

        def fetch() -> None:
            found = obstore.get(self.store, key)
            if found.meta["size"] > most_bytes:
                message = f"{found.meta['size']} bytes are more than {most_bytes}"
                raise OSError(errno.EFBIG, message, f"{self.root}/{key}")
            with path.open("wb") as file:
                for piece in found.stream(min_chunk_size=1 << 20):
                    file.write(piece)

        self._ask("reading", fetch, key)

    def write(self, key: str, content: bytes | memoryview | Path) -> None:
        """Make an object of a content or of a local file, or replace it."""
        import obstore

        self._ask(
            "writing",
            lambda: obstore.put(self.store, key, content, chunk_size=_PART_BYTES),
            key,
        )

    def create(self, key: str, content: bytes) -> bool:
        """Make an object that must not exist; one request, never in parts.

        An answer may be lost on its way, and the request be repeated. So an object that is there
        and has the same content counts as made: what is created has to differ from what others
        create.

        Returns:
            Whether it is ours; False: somebody else has made it.

        Raises:
            StorageError: whether it exists cannot be found out.
        """
        import obstore
        from obstore.exceptions import AlreadyExistsError, BaseError, PreconditionError

        def send() -> None:
            obstore.put(self.store, key, content, mode="create", use_multipart=False)

        pause_s = _FIRST_BACKOFF_S
        for tries_left in range(_TRIES - 1, -1, -1):
            try:
                self.requests.answer(send)
            except (AlreadyExistsError, PreconditionError):
                try:
                    return self.read(key) == content
                except FileNotFoundError:
                    pass  # removed meanwhile: try again
            except (BaseError, FileNotFoundError, OSError, ValueError) as error:
                if not tries_left:
                    raise explain(error, self.root, "creating", key) from None
                failure = explain(error, self.root, "creating", key)
                if isinstance(failure, BadInputError):
                    raise failure from None
            else:
                return True
            self.requests.pause(pause_s)
            pause_s = min(2 * pause_s, _MOST_BACKOFF_S)
        raise StorageError(f"{self.root}/{key} vanishes.", "See what removes it.")

    def size(self, key: str) -> int | None:
        """Size of an object in bytes; None: there is none."""
        try:
            return self.stat(key).st_size
        except FileNotFoundError:
            return None

    def stat(self, key: str) -> RemoteStat:
        """Size and time of an object.

        Raises:
            FileNotFoundError: there is none.
        """
        import obstore

        found = self._ask("asking for", lambda: obstore.head(self.store, key), key)
        return RemoteStat(int(found["size"]), found["last_modified"].timestamp())

    def below(self, key: str) -> list[RemoteObject]:
        """All objects below a path, sorted by key."""
        import obstore

        def listed() -> list[RemoteObject]:
            pages = obstore.list(self.store, key or None, chunk_size=1000)
            return [
                RemoteObject(one["path"], int(one["size"]), one["last_modified"].timestamp())
                for page in pages
                for one in page
            ]

        return sorted(self._ask("listing", listed, key), key=lambda found: found.key)

    def beginning(self, key: str) -> list[str]:
        """The keys in one folder whose name begins with that of ``key``; several may."""
        import obstore

        folder = key.rpartition("/")[0]

        def listed() -> list[str]:
            pages = obstore.list(self.store, folder, offset=key, chunk_size=1000)
            names = (one["path"] for page in pages for one in page)
            return list(takewhile(lambda name: name.startswith(key), names))

        return self._ask("listing", listed, folder)

    def has_any(self, key: str) -> bool:
        """Whether an object lies below a path."""
        import obstore

        def found() -> bool:
            return any(obstore.list(self.store, key or None, chunk_size=1))

        return self._ask("listing", found, key)

    def folders(self, key: str) -> list[str]:
        """Names of the folders directly below a path, sorted."""
        return self.listing(key)[0]

    def listing(self, key: str) -> tuple[list[str], list[str]]:
        """Names of the folders, and of the objects, directly below a path, sorted."""
        import obstore

        found = self._ask(
            "listing", lambda: obstore.list_with_delimiter(self.store, key or None), key
        )
        folders = [prefix.rstrip("/").rpartition("/")[2] for prefix in found["common_prefixes"]]
        return sorted(folders), sorted(one["path"].rpartition("/")[2] for one in found["objects"])

    def delete(self, keys: Iterable[str]) -> None:
        """Remove objects; those that are not there are none too many.

        Many go in one request, which the library does not repeat; to repeat it does no harm.
        """
        import obstore

        left, tries_left = list(keys), _TRIES
        while left:
            some, left = left[:_DELETED_AT_ONCE], left[_DELETED_AT_ONCE:]
            try:
                self.requests.answer(partial(obstore.delete, self.store, some))
            except RequestGivenUpError:
                raise
            except Exception as error:  # noqa: BLE001 - all of the library's are explained
                if is_missing_object(error):
                    continue
                if is_unsupported(error) and self._bulk_delete:
                    self._bulk_delete = False
                    self.store = self._opened(bulk_delete=False)
                else:
                    tries_left -= 1
                    failure = explain(error, self.root, "removing", some[0])
                    if not tries_left or isinstance(failure, BadInputError):
                        raise failure from None
                    self.requests.pause(_FIRST_BACKOFF_S * (_TRIES - tries_left))
                left = some + left

    def _ask(self, doing: str, question: Callable[[], Result], key: str) -> Result:
        try:
            return self.requests.answer(question)
        except Exception as error:
            if isinstance(error, OSError) and error.errno is not None:
                raise  # of this machine
            raise explain(error, self.root, doing, key) from None

    def _opened(self, *, bulk_delete: bool) -> ObjectStore:
        try:
            from obstore.store import from_url
        except ImportError as error:
            raise BadInputError(
                f"{self.root}: object stores need a package that is not installed.",
                "Install it: pip install 'carstage[cloud]'.",
            ) from error
        from datetime import timedelta

        scheme = self.root.partition(":")[0]
        endpoint = next(filter(None, map(os.environ.get, _ENDPOINTS[scheme])), "")
        client: dict[str, Any] = {
            "timeout": timedelta(seconds=_TIMEOUT_S),
            "connect_timeout": timedelta(seconds=_CONNECT_S),
        }
        if endpoint.startswith("http://"):  # said so by whoever set it
            client["allow_http"] = True
        backoff = {
            "init_backoff": timedelta(seconds=_FIRST_BACKOFF_S),
            "max_backoff": timedelta(seconds=_MOST_BACKOFF_S),
            "base": 2,
        }
        options: dict[str, Any] = {
            "config": _config(scheme, endpoint, bulk_delete=bulk_delete),
            "client_options": client,
            "retry_config": {
                "max_retries": _RETRIES,
                "retry_timeout": timedelta(seconds=_RETRY_FOR_S),
                "backoff": backoff,
            },
        }
        try:
            return from_url(self.root, **options)
        except Exception as error:  # noqa: BLE001 - all of the library's are explained
            raise explain(error, self.root, "opening", "") from None


@cache
def remote_files(root: str) -> RemoteFiles:
    """The objects below an address; one set of connections per process."""
    return RemoteFiles(root)


def _config(scheme: str, endpoint: str, *, bulk_delete: bool) -> Any:
    """Settings that are not the environment's own, which ``obstore`` reads itself."""
    if scheme != "s3":
        return None
    config: dict[str, Any] = {"checksum_algorithm": "sha256", "conditional_put": "etag"}
    config.update(aws_profile(os.environ))
    if endpoint:
        config["endpoint"] = endpoint
    if not bulk_delete:
        config["disable_bulk_delete"] = True
    return config
