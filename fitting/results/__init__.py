"""Results of fits: report, file, plots, draws from the posterior."""
