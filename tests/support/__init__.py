"""What several test files and benchmarks share: shapes, rigs, jobs, tables."""
