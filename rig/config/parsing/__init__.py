"""From the text of a rig.yaml to values with their places, and what is said of those that are wrong."""
