"""Covers whose elements need two sets that go together, as two views of a point do."""
