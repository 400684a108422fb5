"""``python -m carstage.cli``: the same as the ``carstage`` command."""

from carstage.cli import main

main()
