"""Benchmarks: ours beside others' in one process, round by round, as ratios that survive a noisy machine."""
