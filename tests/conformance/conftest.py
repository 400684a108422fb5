"""The option with which the conformance test writes the documentation's table."""

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--write-table", action="store_true", help="write docs/client-api-coverage.md")
