"""Units, names, errors, log and optional packages: what every other room may use."""
