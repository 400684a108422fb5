"""Options of the check of the client's API."""

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--write-table", action="store_true", help="write docs/client-api-coverage.md")
    parser.addoption(
        "--only-names", help="try only names of the client with this part; an empty one tries all"
    )
