# What is typed while working on goniod. `just` lists it; what must hold before a change lands is in .ci/run.

_list:
    @just --list --unsorted

# Formatting, lints and the quick tests: under a minute once all is built
check:
    .ci/run fmt clippy quick_tests

# Every test
test:
    .ci/run test

# Everything that must hold before a change lands
ci:
    .ci/run

# What a model evaluation, a sample and a filled table cost
bench:
    cargo bench -p pdv --bench model

# What is handed out, in target/dist: Debian package, static programs, image, schemas, bill of materials, checksums
dist:
    packaging/dist

# A trial at full length, by hand: campaign, wire, kills, operator, legs, floods, strangers, host, peer, picture or dist
trials name:
    .ci/trials {{ name }}
