"""Steps of a run, as `pipeline` takes them one after the other."""
