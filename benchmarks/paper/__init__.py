"""The paper's equations and experiments."""
