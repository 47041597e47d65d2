"""The plots of the report, each a figure that the page draws."""
