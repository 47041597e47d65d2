from drivers.codecs import checksums

CHECK = b"123456789"  # the customary check string of CRC catalogues


def test_checksums_give_the_catalogue_values():
    assert checksums.crc32_mpeg2(CHECK) == 0x0376E6E7
    assert checksums.crc16_xmodem(CHECK) == 0x31C3
    assert checksums.crc8_07(CHECK, seed=0x00) == 0xF4
    assert checksums.crc8_07(CHECK) == 0xFB
    assert checksums.xor8(CHECK) == 0x31
    assert checksums.sum8(CHECK) == 0xDD
