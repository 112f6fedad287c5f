/** An axis bound to the symbols of a real-time client: symbols found, configurations refused, and
 *  the destination of each value. The client is a table here; it counts as the real one does. */
#include <string.h>

#include "builder.h"
#include "fsn/axis.h"
#include "fsn/client.h"

enum { MOST = 32 };

struct fsn_realtime {
    struct fsn_realtime_symbol symbol[MOST];
    uint64_t raw[MOST], set[MOST];
    uint32_t count;
};

static struct fsn_realtime table;

fsn_status fsn_realtime_symbol(const struct fsn_realtime *realtime, uint32_t symbol,
                               struct fsn_realtime_symbol *info) {
    if (symbol >= realtime->count) {
        return FSN_E_ARG;
    }
    *info = realtime->symbol[symbol];
    return FSN_OK;
}

static int32_t find(const struct fsn_realtime *realtime, const char *name, bool output) {
    for (uint32_t i = 0; i < realtime->count; i++) {
        const struct fsn_realtime_symbol *symbol = &realtime->symbol[i];
        if (symbol->output == output && strcmp(symbol->name, name) == 0) {
            return (int32_t)i;
        }
    }
    return FSN_REALTIME_NONE;
}

int32_t fsn_realtime_input(const struct fsn_realtime *realtime, const char *name) {
    return find(realtime, name, false);
}

int32_t fsn_realtime_output(const struct fsn_realtime *realtime, const char *name) {
    return find(realtime, name, true);
}

uint64_t fsn_realtime_get(const struct fsn_realtime *realtime, int32_t symbol) {
    return symbol < 0 ? 0 : realtime->raw[symbol];
}

fsn_status fsn_realtime_set(struct fsn_realtime *realtime, int32_t symbol, uint64_t raw) {
    CHECK(symbol >= 0 && realtime->symbol[symbol].owned);
    realtime->set[symbol] = raw;
    return FSN_OK;
}

static void add(const char *subdevice, const char *name, uint16_t index, uint32_t bits) {
    static const uint16_t outputs[] = {0x6040, 0x6060, 0x607A, 0x60FF, 0x6071};
    bool output = false;
    for (size_t i = 0; i < sizeof outputs / sizeof outputs[0]; i++) {
        output = output || (index & 0x77FF) == (outputs[i] & 0x77FF);
    }
    CHECK(table.count < MOST);
    table.symbol[table.count++] = (struct fsn_realtime_symbol){.name = name,
                                                               .subdevice = subdevice,
                                                               .index = index,
                                                               .bits = bits,
                                                               .output = output,
                                                               .owned = output};
}

/** A device with two axes, after one whose name has the same prefix. */
static void set_up(void) {
    table = (struct fsn_realtime){.count = 0};
    add("drive", "drive.word", 0x6041, 16);
    add("drive.a", "drive.a.word", 0x6041, 16);
    add("drive.a", "drive.a.part", 0, 16);
    add("drive.a", "drive.a.0x6061:00", 0x6061, 8);
    add("drive.a", "drive.a.position", 0x6064, 32);
    add("drive.a", "drive.a.0x606C:00", 0x606C, 32);
    add("drive.a", "drive.a.0x6077:00", 0x6077, 16);
    add("drive.a", "drive.a.control", 0x6040, 16);
    add("drive.a", "drive.a.0x6060:00", 0x6060, 8);
    add("drive.a", "drive.a.0x607A:00", 0x607A, 32);
    add("drive.a", "drive.a.0x60FF:00", 0x60FF, 32);
    add("drive.a", "drive.a.0x6071:00", 0x6071, 16);
    add("drive.a", "drive.a.0x6841:00", 0x6841, 16);
    add("drive.a", "drive.a.0x6864:00", 0x6864, 32);
    add("drive.a", "drive.a.0x6840:00", 0x6840, 16);
    add("drive.a", "drive.a.0x687A:00", 0x687A, 32);
    add("drive.a", "drive.a.vendor", 0x2000, 8);
}

static uint64_t *at(uint64_t *values, const char *name) {
    const int32_t input = fsn_realtime_input(&table, name);
    const int32_t symbol = input >= 0 ? input : fsn_realtime_output(&table, name);
    CHECK(symbol >= 0);
    return &values[symbol];
}

static struct fsn_axis_options options_of(const char *subdevice, uint32_t number, int8_t mode) {
    return (struct fsn_axis_options){
        .subdevice = subdevice,
        .number = number,
        .config = {.mode = mode, .max_step = 100, .max_velocity = 100, .max_torque = 100}};
}

static struct fsn_realtime_axis opened(const struct fsn_axis_options *options) {
    struct fsn_realtime_axis axis;
    CHECK(fsn_realtime_axis_open(&table, options, &axis, NULL) == FSN_OK);
    return axis;
}

static void values_go_where_they_belong(void) {
    set_up();
    struct fsn_axis_options options = options_of("drive.a", 0, FSN_AXIS_CSP);
    options.torque_off = "drive.a.vendor";
    options.torque_off_mask = 4;
    struct fsn_realtime_axis axis = opened(&options);
    struct fsn_realtime_cycle cycle = {.now_ns = 1000000};
    *at(table.raw, "drive.a.word") = 0x50;
    *at(table.raw, "drive.a.0x6061:00") = 0xFF;
    *at(table.raw, "drive.a.position") = 0xFFFFFFFE;
    *at(table.raw, "drive.a.0x606C:00") = 0x80000000;
    *at(table.raw, "drive.a.0x6077:00") = 0xFFFD;
    fsn_realtime_axis_step(&axis, &table, &cycle);
    CHECK(axis.axis.state == FSN_AXIS_SWITCH_ON_DISABLED && axis.axis.inputs.mode == -1);
    CHECK(axis.axis.inputs.position == -2 && axis.axis.inputs.velocity == INT32_MIN);
    CHECK(axis.axis.inputs.torque == -3 && axis.axis.inputs.now_ns == 1000000);
    CHECK((uint32_t)*at(table.set, "drive.a.0x607A:00") == 0xFFFFFFFE);
    CHECK(*at(table.set, "drive.a.0x6060:00") == 8 && axis.axis.phase == FSN_AXIS_OFF);
    CHECK(fsn_axis_enable(&axis.axis) == FSN_OK);
    fsn_realtime_axis_step(&axis, &table, &cycle);
    CHECK(*at(table.set, "drive.a.control") == 6 && *at(table.set, "drive.a.0x6840:00") == 0);
    *at(table.raw, "drive.a.vendor") = 4;
    fsn_realtime_axis_step(&axis, &table, &cycle);
    CHECK(axis.axis.phase == FSN_AXIS_TORQUE_OFF && *at(table.set, "drive.a.control") == 0);
    options.torque_off_low = true;
    axis = opened(&options);
    fsn_realtime_axis_step(&axis, &table, &cycle);
    CHECK(axis.axis.phase == FSN_AXIS_OFF);
    *at(table.raw, "drive.a.vendor") = 3;
    fsn_realtime_axis_step(&axis, &table, &cycle);
    CHECK(axis.axis.phase == FSN_AXIS_TORQUE_OFF);
}

/** Axis 1 has no modes, no velocity and no torque in its process data. */
static void the_second_axis_of_a_device(void) {
    set_up();
    const struct fsn_axis_options options = options_of("drive.a", 1, FSN_AXIS_CSP);
    struct fsn_realtime_axis axis = opened(&options);
    const struct fsn_realtime_cycle cycle = {.now_ns = 1000000};
    *at(table.raw, "drive.a.0x6841:00") = 0x31;
    *at(table.raw, "drive.a.0x6864:00") = 77;
    fsn_realtime_axis_step(&axis, &table, &cycle);
    CHECK(*at(table.set, "drive.a.0x6840:00") == 6 && *at(table.set, "drive.a.0x687A:00") == 77);
    CHECK(*at(table.set, "drive.a.control") == 0);
    CHECK(axis.axis.inputs.mode == FSN_AXIS_CSP); /* as the drive was started */
    CHECK(fsn_axis_set_mode(&axis.axis, FSN_AXIS_PP) == FSN_OK);
    CHECK(fsn_axis_set_mode(&axis.axis, FSN_AXIS_CSV) == FSN_E_ARG);
    CHECK(fsn_axis_set_mode(&axis.axis, FSN_AXIS_CST) == FSN_E_ARG);
}

static void what_is_refused(void) {
    static const struct {
        const char *subdevice;
        uint32_t number;
        int8_t mode;
        const char *gone; /**< is not mapped */
        fsn_status status;
        const char *text;
    } cases[] = {
        {"motor", 0, 8, NULL, FSN_E_ARG,
         "axis 0 of motor: 0x6040 is not mapped as an output: unknown axis"},
        {"drive.a", 2, 8, NULL, FSN_E_ARG, "0x7040 is not mapped as an output"},
        {"drive.a", 8, 8, NULL, FSN_E_ARG, "axes 0 to 7"},
        {"drive.a", 0, 8, "drive.a.word", FSN_E_ARG, "0x6041 is not mapped as an input"},
        {"drive.a", 0, 8, "drive.a.0x607A:00", FSN_E_ARG, "0x607a is not mapped as an output"},
        {"drive.a", 0, 9, "drive.a.0x60FF:00", FSN_E_ARG, "0x60ff is not mapped as an output"},
        {"drive.a", 0, 10, "drive.a.0x6071:00", FSN_E_ARG, "0x6071 is not mapped as an output"},
        {"drive.a", 0, 9, "drive.a.position", FSN_E_ARG,
         "0x6064 is not mapped as an input: the first target is the position"},
        {"drive.a", 0, 8, "drive.a.0x6061:00", FSN_E_ARG, "0x6061 is not mapped as an input"},
        {"drive.a", 1, 9, NULL, FSN_E_ARG, "0x68ff is not mapped"},
        {"drive.a", 0, 2, NULL, FSN_E_ARG, "its mode is none of PP, PV"},
    };
    struct fsn_realtime_fault fault;
    struct fsn_realtime_axis axis;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        set_up();
        if (cases[i].gone != NULL) {
            table.symbol[at(table.raw, cases[i].gone) - table.raw].index = 0x3000;
        }
        const struct fsn_axis_options options =
            options_of(cases[i].subdevice, cases[i].number, cases[i].mode);
        CHECK(fsn_realtime_axis_open(&table, &options, &axis, &fault) == cases[i].status);
        CHECK(fault.status == cases[i].status && strstr(fault.text, cases[i].text) != NULL);
    }
    set_up();
    struct fsn_axis_options options = options_of("drive.a", 0, FSN_AXIS_CSP);
    options.torque_off = "nothing";
    options.torque_off_mask = 1;
    CHECK(fsn_realtime_axis_open(&table, &options, &axis, &fault) == FSN_E_ARG);
    CHECK(strstr(fault.text, "no input nothing") != NULL);
    options.torque_off = "drive.a.word";
    options.torque_off_mask = 0;
    CHECK(fsn_realtime_axis_open(&table, &options, &axis, &fault) == FSN_E_ARG);
    options.torque_off = NULL;
    table.symbol[fsn_realtime_output(&table, "drive.a.control")].owned = false;
    CHECK(fsn_realtime_axis_open(&table, &options, &axis, &fault) == FSN_E_CLOSED);
    CHECK(strstr(fault.text, "or with drive.a.*") != NULL);
    set_up();
    table.symbol[fsn_realtime_input(&table, "drive.a.position")].bits = 16;
    CHECK(fsn_realtime_axis_open(&table, &options, &axis, &fault) == FSN_E_ARG);
    CHECK(strstr(fault.text, "drive.a.position has 16 bits, 0x6064 has 32") != NULL);
}

int main(void) {
    values_go_where_they_belong();
    the_second_axis_of_a_device();
    what_is_refused();
    return 0;
}
