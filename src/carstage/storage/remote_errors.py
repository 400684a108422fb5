"""Errors of object stores as ours: what happened, without the secrets that requests hold."""

from __future__ import annotations

import re

from carstage.errors import CarStageError, DiskFullError, StorageError, StoreAccessError

_CODE = re.compile(r"<Code>([A-Za-z0-9_.-]{1,80})</Code>")
_STATUS = re.compile(r"status code: (\d{3})")
_RETRIES = re.compile(r"after (\d+) retries")
_NO_BUCKET = {"NoSuchBucket", "ContainerNotFound", "InvalidBucketName", "AccountNotFound"}
_NO_BUCKET_TEXT = re.compile(r"(bucket|container) (was |is )?(does not exist|not found)", re.I)
_CREDENTIALS = {
    "AuthenticationFailed",
    "AuthorizationHeaderMalformed",
    "ExpiredToken",
    "InvalidAccessKeyId",
    "InvalidAuthenticationInfo",
    "InvalidSecurity",
    "InvalidToken",
    "NoAuthenticationInformation",
    "SignatureDoesNotMatch",
}
_CLOCK = {"RequestTimeTooSkewed", "RequestExpired"}
_FULL = {
    "EntityTooLarge",
    "InsufficientStorage",
    "QuotaExceeded",
    "AccountLimitExceeded",
    "XMinioStorageFull",
    "XMinioAdminBucketQuotaExceeded",
}
_NO_CREDENTIALS = re.compile(
    r"token request|credential|/latest/api/token|169\.254\.169\.254|account must be specified",
    re.IGNORECASE,
)
_HINTS = {
    "s3": "Set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or log in by Amazon's tools.",
    "gs": "Set GOOGLE_APPLICATION_CREDENTIALS, or log in by Google's tools.",
    "az": "Set AZURE_STORAGE_ACCOUNT_NAME and AZURE_STORAGE_ACCOUNT_KEY, or AZURE_STORAGE_SAS_KEY.",
}


def explain(error: Exception, root: str, doing: str, key: str) -> Exception:
    """Our error for one of the store's library.

    Nothing of the request is repeated, as it may hold signatures or tokens: only the store's code
    and status.

    Args:
        error: as the library raised it.
        root: address of the dataset.
        doing: what was being done, such as ``reading``.
        key: the object.

    Returns:
        ``FileNotFoundError`` for an object that is not there, else a ``StorageError``.
    """
    if isinstance(error, CarStageError):
        return error
    text = str(error)
    code, status = (_found(pattern, text) for pattern in (_CODE, _STATUS))
    what = f"{root}: {doing} {key or 'it'} failed"
    said = f" ({', '.join(filter(None, (status, code)))})" if status or code else ""
    kind = type(error).__name__
    if code in _NO_BUCKET or (status == "404" and _NO_BUCKET_TEXT.search(text)):
        return StoreAccessError(
            f"{root}: there is no such bucket{said}.", "Create it, or correct the address."
        )
    if code in _CLOCK:
        return StoreAccessError(
            f"{root}: the store refuses this machine's clock{said}.",
            "Set the clock (NTP); nothing else depends on it.",
        )
    if code in _CREDENTIALS or kind == "UnauthenticatedError" or status == "401":
        return StoreAccessError(
            f"{root}: the store refuses the credentials{said}.", _HINTS[root.partition(":")[0]]
        )
    if code in _FULL or status == "507":
        return DiskFullError(
            f"{what}: the store is full{said}.", "Make room; the same command again continues."
        )
    if kind == "PermissionDeniedError" or status == "403":
        return StoreAccessError(
            f"{what}: these credentials do not permit it{said}.",
            "Permit listing, reading, writing and deleting below the prefix.",
        )
    if isinstance(error, FileNotFoundError) or status == "404":
        return FileNotFoundError(2, "No such object", f"{root}/{key}")
    if not status and _NO_CREDENTIALS.search(text):
        return StoreAccessError(
            f"{root}: no credentials were found.", _HINTS[root.partition(":")[0]]
        )
    if kind == "UnknownConfigurationKeyError" or doing == "opening":
        return StoreAccessError(
            f"{root}: the environment's settings for this store cannot be used.",
            _HINTS[root.partition(":")[0]],
        )
    retries = _found(_RETRIES, text)
    after = f", tried {int(retries) + 1} times" if retries else ""
    return StorageError(
        f"{what}{said or ', as the store cannot be reached'}{after}.",
        "See that the store is up and its address right; the same command again continues.",
    )


def is_missing_object(error: Exception) -> bool:
    """Whether an object was not there."""
    return isinstance(error, FileNotFoundError) and _found(_CODE, str(error)) not in _NO_BUCKET


def is_unsupported(error: Exception) -> bool:
    """Whether the store does not know a kind of request."""
    return _found(_STATUS, str(error)) in ("405", "501") or "DeleteObjects" in str(error)


def _found(pattern: re.Pattern[str], text: str) -> str:
    found = pattern.search(text)
    return found[1] if found else ""
