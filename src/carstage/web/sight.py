"""stub"""

from __future__ import annotations

from carstage.web.checking import ConfigChecker
from carstage.web.errors import WebError
from carstage.web.messages import PreviewRequest


class SightService:
    """Stub."""

    def __init__(self, checker: ConfigChecker) -> None: ...

    def look(self, request: PreviewRequest) -> bytes:
        """Stub."""
        raise WebError(503, "Not yet.", code="warming")

    def warm(self) -> bool:
        """Stub."""
        return False

    def close(self) -> None:
        """Stub."""
