#!/usr/bin/env python3
"""Copies what the README shows from the folder of a benchmark: readme_pictures.py BENCH_DIR PICTURES_DIR

The plot over all scenes, and for some scenes the truth and each technique's visibility.
"""

import json
import pathlib
import shutil
import sys

# Scene, light, techniques.
SHOWN = [
    ("figure.glb", "disk", ["hard", "pcf", "pcss", "occlusion-textures", "mdi", "ssoc", "dbuffer", "shaft-masks"]),
    ("tube.gltf", "tube", ["pcss", "oess"]),
]


def main():
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    bench, pictures = map(pathlib.Path, sys.argv[1:])
    results = json.loads((bench / "results.json").read_text())
    pictures.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(bench / "plot.svg", pictures / "plot.svg")
    for scene, light, techniques in SHOWN:
        stem = scene.split(".")[0]
        is_it = lambda entry: pathlib.Path(entry["scene"]).name == scene and entry["light"] == light
        truths = [entry for entry in results["references"] if is_it(entry)]
        if not truths:
            raise SystemExit(f"error: {bench}: no light `{light}` of {scene} in these results")
        shutil.copyfile(bench / truths[0]["image"], pictures / f"{stem}-truth.png")
        for technique in techniques:
            images = [e["image"] for e in results["images"] if is_it(e) and e["label"] == technique]
            if not images or not images[0]:
                raise SystemExit(f"error: {bench}: no image of `{technique}` on {scene}")
            shutil.copyfile(bench / images[0], pictures / f"{stem}-{technique}.png")


main()
