import numpy as np

from psstereo.flags import FLAGS, Flag, count_flags, describe_flags, fatal_mask


def test_every_bit_is_declared_once():
    assert [info.flag for info in FLAGS] == list(Flag)
    bits = [int(flag) for flag in Flag]
    assert bits == [1 << i for i in range(len(bits))]
    assert max(bits) < 1 << 16
    sentences = [info.sentence for info in FLAGS]
    assert len(set(sentences)) == len(sentences)
    assert all(s[0].isupper() and s.endswith(".") for s in sentences)


def test_fatal_bits_alone_are_fatal():
    fatal = {Flag.OUTSIDE_MASK, Flag.TOO_FEW_LIGHTS, Flag.RANK_DEFICIENT, Flag.NO_SIGNAL, Flag.NOT_FINITE}
    every = np.arange(1 << 11, dtype=np.uint16).reshape(32, 64)
    expected = np.vectorize(lambda bits: any(bits & int(f) for f in fatal))(every)
    np.testing.assert_array_equal(fatal_mask(every), expected)
    assert {info.flag for info in FLAGS if info.fatal} == fatal


def test_counts_by_name():
    flags = np.array([[0, 1, 3], [128, 130, 1]], np.uint16)
    assert count_flags(flags) == {"OUTSIDE_MASK": 3, "TOO_FEW_LIGHTS": 2, "SHADOWED": 2}
    assert count_flags(np.zeros((2, 2), np.uint16)) == {}


def test_sentences_of_a_pixel():
    assert describe_flags(0) == []
    both = describe_flags(int(Flag.SHADOWED | Flag.NO_REDUNDANCY))
    assert len(both) == 2
    assert "shadow" in both[0]
    assert "three observations" in both[1]
