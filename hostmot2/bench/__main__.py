"""python -m hostmot2.bench: all benchmarks, or those named."""

from hostmot2.bench.command import bench

bench(prog_name="python -m hostmot2.bench")
