"""Which database a catalog is: what the user wrote, the environment, or the dataset's own file."""

from __future__ import annotations

import hashlib
import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal
from urllib.parse import parse_qsl, unquote, urlsplit

from carstage.cache import cache_folder
from carstage.errors import BadInputError
from carstage.storage import DatasetPath

CATALOG_VARIABLE = "CARSTAGE_CATALOG"
"""Environment variable with the address of the catalog; the one place for a password in it."""
CATALOG_FILE = "catalog.sqlite"
"""In the folder of a dataset on this machine."""

_POSTGRES = ("postgresql", "postgres", "postgresql+psycopg")
_SECRET = re.compile(r"(?i)\b(password|passwd|sslpassword|token)=[^&\s'\"]+")
_USER_INFO = re.compile(r"://([^/@\s:]*):[^@\s]*@")
_SECRETS = ("password", "passwd", "sslpassword", "token")
HERE = "."
"""Location of the dataset in whose folder the catalog lies, so that the folder may be moved."""


@dataclass(frozen=True, slots=True)
class CatalogAddress:
    """The database of a catalog.

    Attributes:
        kind: ``sqlite`` or ``postgresql``.
        url: for SQLAlchemy; it may hold a password, and is shown to nobody.
        file: of an SQLite catalog.
    """

    kind: Literal["sqlite", "postgresql"]
    url: str = field(repr=False)
    file: Path | None = None

    @property
    def shown(self) -> str:
        """The address without its password."""
        if self.file is not None:
            return str(self.file)
        return masked(self.url).replace("postgresql+psycopg:", "postgresql:", 1)

    @property
    def secrets(self) -> tuple[str, ...]:
        """What must not stand in a message."""
        if self.kind == "sqlite":
            return ()
        parts = urlsplit(self.url)
        given = [value for name, value in parse_qsl(parts.query) if name.lower() in _SECRETS]
        if parts.password:
            given += [parts.password, unquote(parts.password)]
        return tuple(sorted(set(given), key=len, reverse=True))

    def without_secrets(self, text: str) -> str:
        """A text of a driver or a server, as it may be shown."""
        for secret in self.secrets:
            text = text.replace(secret, "***")
        return masked(text)


def masked(text: str) -> str:
    """A text whose addresses have no passwords any more."""
    return _SECRET.sub(r"\1=***", _USER_INFO.sub(r"://\1:***@", text))


def catalog_address(given: str | None, dataset: DatasetPath | None = None) -> CatalogAddress:
    """The catalog to use: the one that is given, else the environment's, else the dataset's own.

    Args:
        given: as after ``--catalog``: ``postgresql://…``, ``sqlite:///FILE`` or the path of a file.
        dataset: place of a dataset, a folder or what stands for one in a store.

    Raises:
        BadInputError: it is no such address, holds a password outside of the environment, or there
            is none.
    """
    if given:
        return parse_address(given, secret=False)
    named = os.environ.get(CATALOG_VARIABLE)
    if named:
        return parse_address(named, secret=True)
    if dataset is None:
        raise BadInputError(
            "No catalog is named.", f"Name a dataset, add --catalog URL, or set {CATALOG_VARIABLE}."
        )
    return own_catalog(dataset)


def own_catalog(dataset: DatasetPath) -> CatalogAddress:
    """The SQLite file that a dataset has where no other catalog is named.

    It lies in the dataset's folder. That of a dataset in a store lies in the user's cache folder.
    """
    if isinstance(dataset, Path):
        return _file(dataset / CATALOG_FILE)
    name = hashlib.sha256(str(dataset).encode()).hexdigest()[:16]
    return _file(cache_folder() / "catalogs" / f"{name}.sqlite")


def location_of(dataset: DatasetPath, address: CatalogAddress) -> str:
    """By which name a catalog knows a dataset: its URL, or the absolute path of its folder."""
    if not isinstance(dataset, Path):
        return str(dataset)
    folder = _absolute(dataset)
    if address.file is not None and _absolute(address.file.parent) == folder:
        return HERE
    return str(folder)


def _absolute(folder: Path) -> Path:
    """One path of a folder, also where it is named by the folder above another one."""
    return folder.resolve() if ".." in folder.parts else folder.absolute()


def parse_address(text: str, *, secret: bool) -> CatalogAddress:
    """Read an address.

    Args:
        text: as the user wrote it.
        secret: whether it may hold a password.

    Raises:
        BadInputError: it is no address of a catalog, or holds a password that it may not.
    """
    scheme, separator, rest = text.partition("://")
    if not separator:
        return _file(Path(text).expanduser())
    scheme = scheme.lower()
    if scheme == "sqlite":
        if not rest.startswith("/") or len(rest) < 2:
            raise BadInputError(
                f"catalog: {text} names no file.", "Write sqlite:///FILE or sqlite:////PATH."
            )
        return _file(Path(rest[1:]))
    if scheme not in _POSTGRES:
        raise BadInputError(
            f"catalog: {scheme}:// is no database that Car-STAGE knows.",
            "Write postgresql://USER@HOST/DATABASE, sqlite:///FILE, or the path of a file.",
        )
    address = CatalogAddress("postgresql", f"postgresql+psycopg://{rest}")
    if address.secrets and not secret:
        raise BadInputError(
            f"catalog: {masked(text)} holds a password, which others could see.",
            f"Set {CATALOG_VARIABLE} to the address, or PGPASSWORD, or write ~/.pgpass.",
        )
    return address


def _file(path: Path) -> CatalogAddress:
    return CatalogAddress("sqlite", "sqlite://", path)
