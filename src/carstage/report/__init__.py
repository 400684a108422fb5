"""Pages to be looked at, each one file without outside parts: the report, and a verdict."""

from carstage.report.page import report_file, write_report
from carstage.report.verdict import write_validation

__all__ = ["report_file", "write_report", "write_validation"]
