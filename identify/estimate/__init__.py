"""Parameters from signals: regression, output error, profile likelihood, the final fit."""
