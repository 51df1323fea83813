"""The sample head that ringrig generates."""
