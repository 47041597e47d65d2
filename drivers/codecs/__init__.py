"""Wire codecs: pure bytes to values and back, without I/O. Drivers and emulators share them."""
