"""Set covers: fewest, cheapest, most weight; with bounds."""
