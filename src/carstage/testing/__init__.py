"""Conformance suites: subclass one in your tests to check your own store or codec.

Importing a suite needs ``pytest``; nothing else of Car-STAGE imports this package.
"""
