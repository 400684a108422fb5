"""Runs one module of CARLA's smoke tests: ``MODULE RESULTS``, from the folder above ``smoke``.

Run by the interpreter that has the client wheel, with nothing of this project. It writes a JSON
line into the file ``RESULTS`` for each case as it begins and as it ends.
"""

from __future__ import annotations

import json
import sys
import time
import unittest
from pathlib import Path
from typing import Any


class RecordedResult(unittest.TextTestResult):
    """Writes each case as it begins and ends."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._reason, self._result, self._begin_s = "", "passed", 0.0

    def _write(self, **row: object) -> None:
        with Path(sys.argv[2]).open("a") as results:
            results.write(json.dumps(row) + "\n")

    def startTest(self, test: unittest.TestCase) -> None:  # noqa: N802 - the base's name
        """The case begins."""
        super().startTest(test)
        self._reason, self._result, self._begin_s = "", "passed", time.monotonic()
        self._write(case=test.id(), began=True)

    def _bad(self, error: Any) -> None:
        self._result = "failed"
        self._reason = self._reason or f"{error[0].__name__}: {str(error[1])[:300]}"

    def addError(self, test: unittest.TestCase, err: Any) -> None:  # noqa: N802
        """It raised."""
        super().addError(test, err)
        self._bad(err)

    def addFailure(self, test: unittest.TestCase, err: Any) -> None:  # noqa: N802
        """It found something wrong."""
        super().addFailure(test, err)
        self._bad(err)

    def addSkip(self, test: unittest.TestCase, reason: str) -> None:  # noqa: N802
        """It says itself that it does not run here."""
        super().addSkip(test, reason)
        self._result, self._reason = "not run", reason

    def stopTest(self, test: unittest.TestCase) -> None:  # noqa: N802
        """The case has ended, its tear-down too."""
        super().stopTest(test)
        seconds = time.monotonic() - self._begin_s
        self._write(case=test.id(), result=self._result, reason=self._reason, seconds=seconds)


if __name__ == "__main__":
    sys.path.insert(0, "")
    found = unittest.defaultTestLoader.loadTestsFromName(sys.argv[1])
    ended = unittest.TextTestRunner(resultclass=RecordedResult).run(found)
    sys.exit(0 if ended.wasSuccessful() else 1)
