#include "fuzz.h"

uint8_t *fuzz_seed(size_t number, size_t *len) {
    return number == 0   ? build_estop(len)
           : number == 1 ? build_full(len)
           : number == 2 ? build_with_safety(len)
                         : NULL;
}
