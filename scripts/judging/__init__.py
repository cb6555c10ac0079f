"""Parts of `scripts/judge.py`: benches, tasks, the bands that are judged, real runs, scores."""
