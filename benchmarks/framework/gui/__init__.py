"""The graphical interface as a user feels it: how fast it is there, follows, and shows.

``carstage gui`` runs in a process of its own, Chromium with WebGL in software before it.
"""

from benchmarks.framework.gui.measuring import measure_gui

__all__ = ["measure_gui"]
