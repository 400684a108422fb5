"""The check of the client's whole API: each name of ``dir(carla)`` is called, its effect seen.

One module per class of the client registers trials; ``playing`` plays them in the interpreter of
any client wheel, for ``run``; ``page`` writes the table of the documentation from the same entries.
"""
