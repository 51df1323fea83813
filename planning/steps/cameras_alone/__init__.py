"""`--pattern none`: cameras alone, from the request to the plan."""
