"""The store of a run, measures, plots and the report."""
