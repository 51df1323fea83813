"""Lit, seen and measured, written again from `docs/semantics.md`."""
