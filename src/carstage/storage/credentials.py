"""Amazon's own files of credentials, for whoever has logged in by their tools."""

from __future__ import annotations

import configparser
from collections.abc import Mapping
from pathlib import Path

_ELSEWHERE = (
    "AWS_ACCESS_KEY_ID",
    "AWS_WEB_IDENTITY_TOKEN_FILE",
    "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI",
    "AWS_CONTAINER_CREDENTIALS_FULL_URI",
    "AWS_SKIP_SIGNATURE",
)
"""Variables by which the store's library finds credentials itself."""
_KEYS = {
    "aws_access_key_id": "access_key_id",
    "aws_secret_access_key": "secret_access_key",
    "aws_session_token": "session_token",
    "region": "region",
}


def aws_profile(environment: Mapping[str, str]) -> dict[str, str]:
    """Settings of the profile of ``~/.aws`` that the environment chooses; empty where it has none.

    ``AWS_PROFILE``, ``AWS_SHARED_CREDENTIALS_FILE`` and ``AWS_CONFIG_FILE`` count as for Amazon's
    tools. Where the environment has credentials, it is not read: they count for more there, too.

    Args:
        environment: variables of this process.
    """
    if any(environment.get(name) for name in _ELSEWHERE):
        return {}
    home = Path(environment.get("HOME") or "/nonexistent") / ".aws"
    profile = environment.get("AWS_PROFILE") or "default"
    found: dict[str, str] = {}
    for variable, usual, section in (
        ("AWS_CONFIG_FILE", "config", profile if profile == "default" else f"profile {profile}"),
        ("AWS_SHARED_CREDENTIALS_FILE", "credentials", profile),
    ):
        parser = configparser.RawConfigParser()
        try:
            parser.read(environment.get(variable) or home / usual, "utf-8")
        except (OSError, configparser.Error, UnicodeDecodeError):
            continue  # without it, the store says what is missing
        if parser.has_section(section):
            values = dict(parser.items(section))
            found.update({_KEYS[key]: values[key] for key in _KEYS if values.get(key)})
    if environment.get("AWS_REGION") or environment.get("AWS_DEFAULT_REGION"):
        found.pop("region", None)
    return found
