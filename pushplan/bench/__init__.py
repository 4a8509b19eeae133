"""Benchmarks: suites of push problems, run in bulk, stored and reported."""
