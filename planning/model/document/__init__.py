"""The plan file, version 1, as typed values: what is in it and in which order."""
