"""``report.html``: what is in a dataset, to be looked at; one file without outside parts."""

from carstage.dataset.report.page import write_report

__all__ = ["write_report"]
