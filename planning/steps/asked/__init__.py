"""What is asked of a plan: one mesh, several, or ranges."""
