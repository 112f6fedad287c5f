/* An axis by CiA 402 in the cycle of fsn-master: up, a small move there and back, down.
 *
 * axis SOCKET SUBDEVICE STEP CYCLES: moves by STEP units of the drive in each of CYCLES cycles, then
 * back. It moves a real axis: who runs it has made sure that nobody can be hurt. C or C++:
 *
 *   cc -o axis axis.c $(pkg-config --cflags fsn) -lfsn_client
 */
#include <fsn/axis.h>
#include <fsn/client.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* One cycle of the program: 1 when it is at its end, -1 when the axis is not as it should be. */
static int control(struct fsn_axis *axis, int32_t step, long cycles, long *moved) {
    if (axis->enabled && *moved < 2 * cycles) {
        const int32_t by = *moved < cycles ? step : -step;
        *moved += 1;
        return fsn_axis_set_position(axis, axis->outputs.position + by) == FSN_OK ? 0 : -1;
    }
    if (axis->enabled) {
        fsn_axis_disable(axis);
        return 0;
    }
    if (axis->phase == FSN_AXIS_OFF && *moved > 0) {
        return 1;
    }
    /* On its way; else it was stopped, and nothing here enables it again. */
    return axis->phase <= FSN_AXIS_STOPPING ? 0 : -1;
}

int main(int argc, char **argv) {
    if (argc < 5) {
        fprintf(stderr, "usage: axis SOCKET SUBDEVICE STEP CYCLES\n");
        return 2;
    }
    char outputs[256];
    const char *const mine[] = {outputs};
    struct fsn_realtime_options options;
    struct fsn_axis_options wanted;
    struct fsn_realtime_fault fault;
    struct fsn_realtime_cycle cycle;
    struct fsn_realtime_axis axis;
    struct fsn_realtime *rt;
    snprintf(outputs, sizeof outputs, "%s.*", argv[2]);
    memset(&options, 0, sizeof options);
    options.socket = argv[1];
    options.outputs = mine;
    options.output_count = 1;
    options.misses = 10;
    memset(&wanted, 0, sizeof wanted);
    wanted.subdevice = argv[2];
    wanted.config.mode = FSN_AXIS_CSP;
    wanted.config.max_step = (uint32_t)abs(atoi(argv[3]));
    wanted.config.answer_ms = 500;
    if (fsn_realtime_open(&options, &rt, &fault) != FSN_OK) {
        fprintf(stderr, "axis: %s\n", fault.text);
        return 1;
    }
    if (fsn_realtime_axis_open(rt, &wanted, &axis, &fault) != FSN_OK ||
        fsn_axis_enable(&axis.axis) != FSN_OK) {
        fprintf(stderr, "axis: %s\n", fault.text);
        fsn_realtime_close(rt);
        return 1;
    }
    long moved = 0;
    int end = 0;
    while (end == 0 && fsn_realtime_wait(rt, 1000000000, &cycle) == FSN_OK) {
        fsn_realtime_axis_step(&axis, rt, &cycle);
        fsn_realtime_send(rt);
        end = control(&axis.axis, atoi(argv[3]), atol(argv[4]), &moved);
    }
    printf("%s, drive %s, at %ld\n", fsn_axis_phase_name(axis.axis.phase),
           fsn_axis_state_name(axis.axis.state), (long)axis.axis.inputs.position);
    fsn_realtime_close(rt);
    return end == 1 ? 0 : 1;
}
