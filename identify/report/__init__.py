"""The results for the user: terminal summary, files of the results folder, report page."""
