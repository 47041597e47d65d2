"""Wire codecs: pure bytes <-> values, without ports, clocks or threads.

Drivers and emulators share them; each is held against packets captured from real devices.
"""
