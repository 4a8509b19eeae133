"""Benchmarks: suites of push problems, their execution, results and reports."""
