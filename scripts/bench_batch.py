#!/usr/bin/env python3
"""Throughput of `antumbra batch`, which loads a scene once, against a process for each item.

usage: bench_batch.py PROGRAM [ITEMS] [ROUNDS]

Both make the same pictures, in turn, after a round that compiles pipelines and is not counted. Prints
medians, their spread and the ratio; fails if a picture differs.
"""

import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

SCENE = pathlib.Path(__file__).resolve().parent.parent / "assets" / "figure.glb"
TECHNIQUE = "pcss"
SIZE = "128x128"


def timed(commands):
    begun = time.perf_counter()
    for command in commands:
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begun


def main():
    program = pathlib.Path(sys.argv[1]).resolve()
    items = int(sys.argv[2]) if len(sys.argv) > 2 else 24
    rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 5
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        jobs = folder / "jobs.toml"
        jobs.write_text(
            f'[[job]]\nname = "walk"\nscenes = ["{SCENE}"]\ntechniques = ["{TECHNIQUE}"]\n'
            f'frames = "0..{items}"\nfps = 24\nsize = "{SIZE}"\n'
        )
        times = {"one batch": [], "a process for each item": []}
        for number in range(rounds + 1):
            out = folder / str(number)
            lone = out / "lone"
            lone.mkdir(parents=True)
            batch = [[program, "batch", jobs, "--out", out / "batch", "--shard", "1/1"]]
            each = [
                [program, "capture", SCENE, "-o", lone / f"{frame:06}.png", "--technique", TECHNIQUE,
                 "--size", SIZE, "--time", str(frame / 24)]
                for frame in range(items)
            ]
            took = [timed(batch), timed(each)]
            made = sorted((out / "batch").rglob("*.png"))
            if [p.read_bytes() for p in made] != [p.read_bytes() for p in sorted(lone.iterdir())]:
                sys.exit("error: the pictures of the batch are not those of the lone processes")
            if number:
                for seconds, name in zip(took, times):
                    times[name].append(seconds)
        medians = [statistics.median(seconds) for seconds in times.values()]
        for (name, seconds), median in zip(times.items(), medians):
            print(f"{name}: median {median:.2f} s ({min(seconds):.2f} to {max(seconds):.2f}), "
                  f"{items / median:.1f} items/s")
        print(f"ratio: {medians[1] / medians[0]:.2f}")


if __name__ == "__main__":
    main()
