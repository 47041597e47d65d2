"""MATLAB: .mat files of the versions 4, 5 and 7.3."""
