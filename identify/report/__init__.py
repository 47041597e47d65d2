"""What the user gets: the summary on the terminal, the files of the results folder, the page."""
