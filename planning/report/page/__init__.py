"""`report.html`: a plan in one file that opens anywhere, recomputed by the audit."""
