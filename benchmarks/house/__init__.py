"""The house itself: its size, its graph, its plans before and after."""
