"""The web viewer, which reads stored results."""
