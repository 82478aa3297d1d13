"""Histograms against sorting."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hostmot2._core import ffi, lib
from hostmot2.histogram import Histogram

times = st.lists(st.one_of(st.integers(0, 300), st.integers(0, 2**40 - 1)), min_size=1, max_size=200)


@given(times, st.floats(0, 100))
def test_percentile_is_at_most_one_bucket_above_the_exact_one(values, percent):
    histogram = Histogram(values)
    exact = sorted(values)[max(0, math.ceil(percent * len(values) / 100) - 1)]
    assert exact <= histogram.percentile(percent) <= min(max(values), exact + exact // 128)


@given(times)
def test_extremes_mean_and_count_are_exact(values):
    histogram = Histogram(values)
    assert (histogram.minimum, histogram.maximum, len(histogram)) == (min(values), max(values), len(values))
    assert histogram.mean == pytest.approx(sum(values) / len(values), rel=1e-12)


@given(times, times)
def test_merging_is_recording_both(one, other):
    merged, both = Histogram(one), Histogram([*one, *other])
    merged.merge(Histogram(other))
    assert merged.summary() == both.summary()
    assert all(np.array_equal(a, b) for a, b in zip(merged.buckets(), both.buckets(), strict=True))


@given(st.integers(0, 2**40 - 1))
def test_a_bucket_holds_its_values(value):
    histogram = Histogram([value])
    (start,), (width,), (count,) = histogram.buckets()
    assert start <= value < start + width
    assert width <= max(1, value / 128)
    assert count == 1


def test_buckets_follow_each_other_without_gap():
    starts = [lib.hm2_histogram_bucket_start(i) for i in range(4353)]
    assert starts == sorted(set(starts))
    assert starts[0] == 0
    assert starts[-1] == 2**40
    assert lib.hm2_histogram_bucket_start(4354) == -1


def test_times_beyond_the_last_bucket_keep_their_maximum():
    histogram = Histogram([5, 2**50, 2**62])
    assert histogram.maximum == 2**62
    assert histogram.percentile(50) == 2**62  # all that is known of the middle one: it shares a bucket
    assert histogram.minimum == 5


def test_negative_counts_as_zero():
    assert Histogram([-5]).maximum == 0


def test_nothing_recorded_gives_no_number():
    histogram = Histogram([1])
    histogram.reset()
    for ask in (lambda: histogram.minimum, lambda: histogram.mean, lambda: histogram.percentile(50)):
        with pytest.raises(ValueError, match="nothing recorded"):
            ask()
    assert histogram.summary() == {"count": 0}
    assert repr(histogram) == "Histogram: nothing recorded"
    merged = Histogram([7])
    merged.merge(histogram)
    assert merged.minimum == 7
    with pytest.raises(ValueError, match="101"):
        merged.percentile(101)


def test_repr_is_one_line_in_microseconds():
    assert repr(Histogram([1000] * 99 + [2000])) == (
        "Histogram of 100 (us): min 1.00  p50 1.00  p99 1.00  p99.9 2.00  max 2.00"
    )


@pytest.mark.parametrize("percent", [-0.1, 100.1, math.nan])
def test_there_is_no_percentile_outside_of_all_or_of_nothing(percent):
    histogram = ffi.new("hm2_histogram *")
    assert lib.hm2_histogram_percentile(histogram, 50) == -1
    lib.hm2_histogram_record(histogram, 7)
    assert lib.hm2_histogram_percentile(histogram, 50) == 7
    assert lib.hm2_histogram_percentile(histogram, percent) == -1
