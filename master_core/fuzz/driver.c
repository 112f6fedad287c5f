/** Drives the fuzz target without libFuzzer.
 *
 *    fuzz_plan ROUNDS             mutates good plans, the same way every time
 *    fuzz_plan FILE…              replays files, such as what libFuzzer has found
 *    fuzz_plan --seed-corpus DIR  writes good plans for libFuzzer to start from */
#include <string.h>

#include "builder.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static int replay(const char *path) {
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        perror(path);
        return 1;
    }
    static uint8_t bytes[1 << 20];
    const size_t len = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    return LLVMFuzzerTestOneInput(bytes, len);
}

/** Overwrites one aligned 32-bit field with a value that loves to overflow, or with that of another
 *  field, so that references point somewhere else that exists. */
static void mutate_field(uint8_t *bytes, size_t size, uint64_t *seed) {
    static const uint32_t edge[] = {0, 1, 2, 7, 8, 0x7FFFFFFFu, 0x80000000u, 0xFFFFFFF8u, ~0u};
    const size_t at = next_random(seed) % (size / 4) * 4;
    const size_t from = next_random(seed) % (size / 4) * 4;
    const uint32_t value = edge[next_random(seed) % (sizeof edge / sizeof edge[0])];
    if (next_random(seed) % 2 == 0) {
        memmove(bytes + at, bytes + from, 4);
        return;
    }
    for (int i = 0; i < 4; i++) {
        bytes[at + (size_t)i] = (uint8_t)(value >> (8 * i));
    }
}

static void mutate_byte(uint8_t *bytes, size_t size, uint64_t *seed) {
    static const uint8_t edge[] = {0, 1, 0x7F, 0x80, 0xFF};
    const size_t at = next_random(seed) % size;
    bytes[at] = next_random(seed) % 2 ? edge[next_random(seed) % 5] : (uint8_t)next_random(seed);
}

/** Cuts sometimes, changes a few bytes and fields; the target itself mends length and CRC. */
static void mutate(const uint8_t *good, size_t len, uint64_t *seed) {
    const size_t size = next_random(seed) % 8 == 0 ? next_random(seed) % (len + 1) : len;
    uint8_t *bytes = malloc(size > 0 ? size : 1); /* exact, so that ASan sees a reach beyond it */
    CHECK(bytes != NULL);
    memcpy(bytes, good, size);
    for (uint32_t n = next_random(seed) % 5; n > 0 && size >= 4; n--) {
        if (next_random(seed) % 2 == 0) {
            mutate_field(bytes, size, seed);
        } else {
            mutate_byte(bytes, size, seed);
        }
    }
    LLVMFuzzerTestOneInput(bytes, size);
    free(bytes);
}

static int write_corpus(const char *directory) {
    uint8_t *(*const build[])(size_t *) = {build_estop, build_full};
    for (size_t i = 0; i < 2; i++) {
        char path[4096];
        snprintf(path, sizeof path, "%s/plan-%zu", directory, i);
        size_t len;
        uint8_t *bytes = build[i](&len);
        FILE *file = fopen(path, "wb");
        const int written = file != NULL && fwrite(bytes, 1, len, file) == len;
        free(bytes);
        if (file == NULL || fclose(file) != 0 || !written) {
            perror(path);
            return 1;
        }
    }
    return 0;
}

int main(int argc, char **argv) {
    if (argc == 3 && strcmp(argv[1], "--seed-corpus") == 0) {
        return write_corpus(argv[2]);
    }
    char *end = NULL;
    const long rounds = argc == 2 ? strtol(argv[1], &end, 10) : 0;
    if (argc < 2 || end == NULL || *end != 0) {
        int status = 0;
        for (int i = 1; i < argc; i++) {
            status |= replay(argv[i]);
        }
        return status;
    }
    uint8_t *(*const build[])(size_t *) = {build_estop, build_full};
    uint64_t seed = 42;
    for (size_t i = 0; i < 2; i++) {
        size_t len;
        uint8_t *good = build[i](&len);
        for (long round = 0; round < rounds / 2; round++) {
            mutate(good, len, &seed);
        }
        free(good);
    }
    printf("%ld mutated plans\n", rounds);
    return 0;
}
