"""Lit, seen and measured, written again from `docs/reference/semantics.md`."""
