"""The pictures of the documentation: `benchmarks.house.doc_pictures`."""
