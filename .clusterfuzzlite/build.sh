#!/bin/bash -eu
# Builds the C fuzz targets the way OSS-Fuzz and ClusterFuzzLite ask for it: with their compiler,
# their flags and their engine, into $OUT. Runs anywhere these are set:
#   CC=clang CFLAGS='-g -O1 -fsanitize=address,fuzzer-no-link' LIB_FUZZING_ENGINE=-fsanitize=fuzzer \
#     SRC=… OUT=… WORK=… .clusterfuzzlite/build.sh
cd "${FSN_ROOT:-$SRC/fsoe-net}/master_core"
core=$(sed -n '/^set(FSN_RT_SOURCES/,/)/p; /^set(FSN_SETUP_SOURCES/,/)/p' CMakeLists.txt |
    grep -o 'src/[a-z_/]*\.c' | sort -u)
corpus=$(mktemp -d)
trap 'rm -rf "$corpus"' EXIT
for name in plan monitor scan wire; do
    objects=()
    for source in $core tests/builder.c fuzz/chain.c "fuzz/fuzz_$name.c"; do
        object="${WORK:-$corpus}/fuzz_$name-$(echo "$source" | tr / -).o"
        # shellcheck disable=SC2086 - flags are words
        $CC $CFLAGS -std=c11 -Iinclude -Isrc -Itests -Ifuzz -c "$source" -o "$object"
        objects+=("$object")
    done
    # The engine is C++, so is the linker.
    # shellcheck disable=SC2086
    ${CXX:-clang++} ${CXXFLAGS:-$CFLAGS} "${objects[@]}" $LIB_FUZZING_ENGINE -lpthread -o "$OUT/fuzz_$name"
    cp "fuzz/$name.dict" "$OUT/fuzz_$name.dict"
    # The seeds come from the driver, built for this machine and without any sanitizer.
    mkdir "$corpus/$name"
    # shellcheck disable=SC2086
    ${FSN_HOST_CC:-clang} -std=c11 -Iinclude -Isrc -Itests -Ifuzz $core \
        tests/builder.c fuzz/chain.c "fuzz/fuzz_$name.c" "fuzz/seeds_$name.c" fuzz/driver.c \
        -lpthread -o "$corpus/driver"
    "$corpus/driver" --seed-corpus "$corpus/$name"
    (cd "$corpus/$name" && zip -q -X -r "$OUT/fuzz_${name}_seed_corpus.zip" .)
done
