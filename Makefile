.PHONY: help demo test bench bench-check pictures bench-plan bench-batch figures study studies table wgpu-host slurm-test cluster-check soak faults semver clean-deps

# For make bench: scenes, what is held against each other, picture size, and where it goes.
SCENES ?= assets
TECHNIQUES ?= all
SIZE ?= 512x512
OUT ?= out/bench
# For make study: name of a file in benches/studies/, and further options such as --repeat 3.
STUDY ?= occlusion-textures
STUDY_OPTIONS ?= --resume
# For make semver: what the library's interface is held against.
BASELINE ?= $$(git describe --tags --abbrev=0)
# The strongest ray tracer, where its library is: asked by the shell, after set-up may have installed it.
EMBREE = $$([ -f /usr/include/embree3/rtcore.h ] || [ -f /usr/local/include/embree3/rtcore.h ] && echo --features embree)

BIN := $(or $(CARGO_TARGET_DIR),target)/release/antumbra
# For a shell that has not yet read what rustup added to the profile.
export PATH := $(PATH):$(or $(CARGO_HOME),$(HOME)/.cargo)/bin

help:
	@echo "make demo        set up this machine, build in release, capture a scene to out/"
	@echo "make test        set up this machine, then run every check and test"
	@echo "make bench       run time against error of all techniques over all scenes, to out/bench/"
	@echo "make bench-check look at out/bench/report.html in headless Chromium"
	@echo "make pictures    what the README shows of make bench, to docs/pictures/"
	@echo "make figures     scenes after the papers' figures, to out/figures/"
	@echo "make study       the tables of one file of benches/studies/, to out/studies/: STUDY=name"
	@echo "make studies     the tables of all"
	@echo "make table       measures what --technique auto chooses by, to src/shadow/auto/reference.tsv"
	@echo "make bench-plan  criterion benchmarks of the render graph"
	@echo "make bench-batch throughput of a batch against a process for each item"
	@echo "make wgpu-host   lints and runs examples/wgpu-host, an engine on wgpu, to out/wgpu-host.ppm"
	@echo "make slurm-test  32 tasks of a real Slurm on this machine against one process; needs root"
	@echo "make cluster-check  the Kubernetes manifest against its schema"
	@echo "make soak        10,000 frames in one process, without and with the validation layer, half an hour"
	@echo "make faults      of each technique: calls from each place in the code and every allocation fail once, an hour"
	@echo "make semver      what breaks callers since the last tag, or since BASELINE=commit"
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
	scripts/setup.sh bench
	cargo build --release $(EMBREE)
	$(BIN) bench $(SCENES) --techniques '$(TECHNIQUES)' --size $(SIZE) --out $(OUT)

bench-check:
	scripts/report_browser.py $(OUT)/report.html $(OUT)/screenshots

# At the size of the errors that the README names.
pictures: SIZE = 256x256
pictures: bench
	scripts/readme_pictures.py $(OUT) docs/pictures

figures:
	scripts/setup.sh bench
	cargo run --release $(EMBREE) --example make_figures -- out/figures

study: figures
	cargo build --release $(EMBREE)
	for study in $(STUDY); do \
		$(BIN) bench --study benches/studies/$$study.toml --out out/studies/$$study $(STUDY_OPTIONS) || exit 1; done

studies:
	$(MAKE) study STUDY="$(basename $(notdir $(wildcard benches/studies/*.toml)))"

# Build again afterwards: the table is part of the program.
table: figures
	cargo build --release $(EMBREE)
	$(BIN) bench --study benches/studies/auto.toml --out out/studies/auto $(STUDY_OPTIONS) --table src/shadow/auto/reference.tsv

bench-plan:
	scripts/setup.sh demo
	cargo bench

bench-batch:
	scripts/setup.sh demo
	cargo build --release
	scripts/bench_batch.py $(BIN)

# On its own, because wgpu takes minutes to build. Fails if the validation layer has a message.
wgpu-host:
	scripts/setup.sh test
	mkdir -p out
	cd examples/wgpu-host && cargo fmt --check && cargo clippy --locked -- -D warnings && \
		cargo run --locked -- ../../out/wgpu-host.ppm

slurm-test:
	cargo build --release
	BIN=$(BIN) scripts/slurm_test.sh out/slurm

cluster-check:
	scripts/cluster_check.sh

# Without the layer first: what grows there is ours or the driver's. With it, blocks of device memory are kept out of
# malloc's heap, where what is allocated between them makes ever more holes: see docs/robustness.md.
soak:
	scripts/setup.sh test
	ANTUMBRA_SOAK_PLAIN=1 cargo test --test capture_soak -- --ignored --nocapture ten_thousand_frames
	MALLOC_MMAP_THRESHOLD_=1048576 cargo test --test capture_soak -- --ignored --nocapture ten_thousand_frames

faults:
	scripts/setup.sh test
	cargo test --test capture_faults -- --ignored --nocapture

# Needs cargo-semver-checks. Fails if callers would break and the version does not say so.
semver:
	scripts/setup.sh demo
	cargo semver-checks --baseline-rev "$(BASELINE)"

clean-deps:
	rm -rf .deps
