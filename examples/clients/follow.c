/* A loop in the cycle of fsn-master: drives stay where they are.
 *
 * follow SOCKET ACTUAL TARGET [CYCLES]: copies the input ACTUAL to the output TARGET in every
 * cycle, and says at the end how many of its outputs were in time. C or C++:
 *
 *   cc -o follow follow.c $(pkg-config --cflags fsn) -lfsn_client
 */
#include <fsn/client.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int refused(const struct fsn_realtime_fault *fault) {
    fprintf(stderr, "follow: %s\n", fault->text);
    return 1;
}

int main(int argc, char **argv) {
    if (argc < 4) {
        fprintf(stderr, "usage: follow SOCKET ACTUAL TARGET [CYCLES]\n");
        return 2;
    }
    const char *const outputs[] = {argv[3]};
    struct fsn_realtime_options options;
    struct fsn_realtime_fault fault;
    struct fsn_realtime *rt;
    memset(&options, 0, sizeof options);
    options.socket = argv[1];
    options.outputs = outputs;
    options.output_count = 1;
    options.misses = 3;
    if (fsn_realtime_open(&options, &rt, &fault) != FSN_OK) {
        return refused(&fault);
    }
    const int32_t actual = fsn_realtime_input(rt, argv[2]);
    const int32_t target = fsn_realtime_output(rt, argv[3]);
    if (actual == FSN_REALTIME_NONE || target == FSN_REALTIME_NONE) {
        fprintf(stderr, "follow: the plan has no input %s or no output %s\n", argv[2], argv[3]);
        fsn_realtime_close(rt);
        return 1;
    }
    const long cycles = argc > 4 ? atol(argv[4]) : 1000;
    struct fsn_realtime_cycle cycle;
    memset(&cycle, 0, sizeof cycle);
    fsn_status status = FSN_OK;
    for (long i = 0; i < cycles && status == FSN_OK; i++) {
        status = fsn_realtime_wait(rt, 1000000000, &cycle);
        if (status != FSN_OK ||
            fsn_realtime_set_value(rt, target, fsn_realtime_value(rt, actual)) != FSN_OK) {
            break; /* the outputs take their stop values, or keep what was sent last */
        }
        fsn_realtime_send(rt);
    }
    const struct fsn_realtime_counts counts = fsn_realtime_counts(rt);
    printf("cycle %llu: %llu outputs in time, %llu late, %llu cycles without\n",
           (unsigned long long)cycle.cycle, (unsigned long long)counts.on_time,
           (unsigned long long)counts.late, (unsigned long long)counts.missed);
    if (status == FSN_E_CLOSED) {
        fprintf(stderr, "follow: the outputs were taken back\n");
    }
    fsn_realtime_close(rt);
    return status != FSN_OK;
}
