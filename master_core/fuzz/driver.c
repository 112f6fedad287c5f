/** Drives a fuzz target without libFuzzer.
 *
 *    fuzz_NAME ROUNDS [SEED]      mutates good inputs, the same way every time
 *    fuzz_NAME FILE…              replays files, such as what libFuzzer has found
 *    fuzz_NAME --seed-corpus DIR  writes good inputs for libFuzzer to start from */
#include <string.h>

#include "fuzz.h"

static int replay(const char *path) {
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        perror(path);
        return 1;
    }
    static uint8_t room[1 << 20];
    const size_t len = fread(room, 1, sizeof room, file);
    fclose(file);
    uint8_t *bytes = malloc(len > 0 ? len : 1); /* exact, so that ASan sees a reach beyond it */
    CHECK(bytes != NULL);
    memcpy(bytes, room, len);
    const int status = LLVMFuzzerTestOneInput(bytes, len);
    free(bytes);
    return status;
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

/** Cuts sometimes, changes a few bytes and fields; the target itself corrects length and CRC. */
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
    size_t len;
    uint8_t *bytes;
    for (size_t i = 0; (bytes = fuzz_seed(i, &len)) != NULL; i++) {
        char path[4096];
        snprintf(path, sizeof path, "%s/seed-%zu", directory, i);
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

/** Runs the good inputs as they are, then mutated, in turn. */
static void run_rounds(uint64_t rounds, uint64_t seed) {
    size_t len;
    uint8_t *good;
    for (size_t i = 0; (good = fuzz_seed(i, &len)) != NULL; i++) {
        fuzz_reached = 0;
        LLVMFuzzerTestOneInput(good, len);
        CHECK(fuzz_reached > 0);
        free(good);
    }
    for (size_t i = 0; rounds > 0; rounds--, i++) {
        good = fuzz_seed(i, &len);
        if (good == NULL) {
            i = 0;
            good = fuzz_seed(i, &len);
        }
        mutate(good, len, &seed);
        free(good);
    }
}

static bool read_number(const char *text, uint64_t *number) {
    char *end;
    *number = strtoull(text, &end, 10);
    return end != text && *end == 0;
}

int main(int argc, char **argv) {
    if (argc == 3 && strcmp(argv[1], "--seed-corpus") == 0) {
        return write_corpus(argv[2]);
    }
    uint64_t rounds;
    uint64_t seed = 42;
    if ((argc == 2 || argc == 3) && read_number(argv[1], &rounds) &&
        (argc == 2 || read_number(argv[2], &seed))) {
        run_rounds(rounds, seed);
        printf("%llu mutated inputs\n", (unsigned long long)rounds);
        return 0;
    }
    int status = argc < 2;
    for (int i = 1; i < argc; i++) {
        status |= replay(argv[i]);
    }
    return status;
}
