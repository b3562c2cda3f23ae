.PHONY: help demo test bench clean-deps

BIN := $(or $(CARGO_TARGET_DIR),target)/release/antumbra
# For a shell that has not yet read what rustup added to the profile.
export PATH := $(PATH):$(or $(CARGO_HOME),$(HOME)/.cargo)/bin

help:
	@echo "make demo        set up this machine, build in release, capture a scene to out/"
	@echo "make test        set up this machine, then run every check and test"
	@echo "make bench       criterion benchmarks"
	@echo "make clean-deps  remove what set-up unpacked into .deps/"

demo:
	scripts/setup.sh demo
	cargo build --release
	mkdir -p out
	$(BIN) capture assets/sphere_over_plane.gltf -o out/sphere_over_plane.png \
		--visibility out/sphere_over_plane_visibility.exr --report out/report.json
	@echo "Look at out/sphere_over_plane.png (the picture), out/sphere_over_plane_visibility.exr (float visibility), out/report.json (timings)."

test:
	scripts/setup.sh test
	scripts/check.sh

bench:
	scripts/setup.sh demo
	cargo bench

clean-deps:
	rm -rf .deps
