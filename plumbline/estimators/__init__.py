"""Estimators of the piecewise controller, one method per file."""
