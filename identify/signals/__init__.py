"""Recordings become signals: an even grid, the noise, filters, glitches, missing samples."""
