"""The paper's own route to the cameras: largest baselines first."""
