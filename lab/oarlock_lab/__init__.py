"""Tools of the project itself: reproduction of the source paper, benchmarks, emulated devices, synthetic seasons."""
