// Our axis drives the simulated CiA 402 drive of KickCAT, cycle by cycle; prints what happens.
//
// Their drive has no quick stop, faults or safety function, so the statusword between the two is replaced
// where one is tried: by Fault until bit 7 rises, by Switch on disabled as STO shows itself.
#include "kickcat/simulation/devices/Ds402Motor.h"

#include <fsn/axis.h>

#include <cstdio>
#include <cstdlib>

namespace {

struct Objects {
    std::uint16_t controlword = 0, statusword = 0;
    std::int8_t mode = 0, display = 0;
    std::int32_t target = 0, actual = 250000, target_velocity = 0, velocity = 0;
    std::int16_t target_torque = 0, torque = 0;
};

Objects o;
kickcat::slave::Slave slave;
fsn_axis axis;
std::uint64_t now_ns;
int cycles;

void check(bool good, const char *what) {
    if (!good) {
        std::printf("not true in cycle %d: %s (statusword 0x%04x, controlword 0x%04x, %s)\n",
                    cycles, what, o.statusword, o.controlword, fsn_axis_phase_name(axis.phase));
        std::exit(1);
    }
}

void step(kickcat::sim::Ds402Motor &motor, std::uint16_t instead = 0) {
    fsn_axis_inputs inputs{};
    inputs.now_ns = now_ns += 1000000;
    inputs.statusword = instead != 0 ? instead : o.statusword;
    inputs.mode = o.display;
    inputs.position = o.actual;
    inputs.velocity = o.velocity;
    inputs.torque = o.torque;
    fsn_axis_step(&axis, &inputs);
    check(axis.enabled || axis.outputs.position == o.actual, "the target is where the axis stands");
    o.controlword = axis.outputs.controlword;
    o.mode = axis.outputs.mode;
    o.target = axis.outputs.position;
    o.target_velocity = axis.outputs.velocity;
    o.target_torque = axis.outputs.torque;
    motor.step();
    cycles++;
}

void enable(kickcat::sim::Ds402Motor &motor) {
    const int begin = cycles;
    const std::int32_t stands = o.actual;
    check(fsn_axis_enable(&axis) == FSN_OK, "it may be enabled");
    while (!axis.enabled && cycles < begin + 50) {
        step(motor);
    }
    check(axis.enabled, "it is enabled");
    check(o.actual == stands, "it has not moved");
    std::printf("enabled in %d cycles at %d\n", cycles - begin, o.actual);
}

void go(kickcat::sim::Ds402Motor &motor, std::int32_t target, std::int32_t most) {
    const int begin = cycles;
    std::int32_t fastest = 0;
    while (axis.outputs.position != target) {
        const std::int32_t left = target - axis.outputs.position;
        const std::int32_t by = left > most ? most : left < -most ? -most : left;
        const std::int32_t before = o.actual;
        check(fsn_axis_set_position(&axis, axis.outputs.position + by) == FSN_OK, "a step");
        step(motor);
        const std::int32_t moved = std::abs(o.actual - before);
        fastest = moved > fastest ? moved : fastest;
        check(moved <= 2 * most, "no jump");
    }
    for (int i = 0; i < 300; i++) {
        step(motor);
    }
    check(std::abs(o.actual - target) <= 1, "it is there");
    std::printf("moved to %d in %d cycles, %d in the fastest\n", o.actual, cycles - begin, fastest);
}

} // namespace

int main() {
    slave.add(0x6040, &o.controlword);
    slave.add(0x6041, &o.statusword);
    slave.add(0x6060, &o.mode);
    slave.add(0x6061, &o.display);
    slave.add(0x607A, &o.target);
    slave.add(0x6064, &o.actual);
    slave.add(0x60FF, &o.target_velocity);
    slave.add(0x606C, &o.velocity);
    slave.add(0x6071, &o.target_torque);
    slave.add(0x6077, &o.torque);
    kickcat::sim::Ds402Motor motor(slave);
    fsn_axis_config config{};
    config.mode = FSN_AXIS_CSP;
    config.max_step = 100;
    config.max_velocity = 50000;
    check(fsn_axis_init(&axis, &config) == FSN_OK, "a mode");
    for (int i = 0; i < 5; i++) {
        step(motor);
    }
    enable(motor);
    go(motor, 260000, 100);
    check(fsn_axis_set_position(&axis, 0) == FSN_E_ARG, "a jump is refused");
    go(motor, 245000, 60);

    check(fsn_axis_set_mode(&axis, FSN_AXIS_CSV) == FSN_OK, "a mode");
    for (int i = 0; i < 10; i++) {
        step(motor);
    }
    check(axis.enabled && o.display == FSN_AXIS_CSV, "CSV is confirmed");
    check(fsn_axis_set_velocity(&axis, 50000) == FSN_OK, "a velocity");
    for (int i = 0; i < 200; i++) {
        step(motor);
    }
    check(std::abs(o.velocity - 50000) < 500, "it runs");
    std::printf("velocity %d\n", o.velocity);

    step(motor, 0x0250); /* STO as most drives show it, in full motion */
    check(axis.phase == FSN_AXIS_TORQUE_OFF, "expected, no fault");
    for (int i = 0; i < 100; i++) {
        step(motor);
    }
    check(!axis.enabled && axis.phase == FSN_AXIS_TORQUE_OFF, "it does not come back by itself");
    std::printf("after a stop by the drive: %s, drive %s\n", fsn_axis_phase_name(axis.phase),
                fsn_axis_state_name(axis.state));
    enable(motor);
    check(o.target_velocity == 0, "from a standstill");

    for (int i = 0; i < 20; i++) {
        step(motor, 0x0218);
        check((o.controlword & 0x80) == 0, "no fault is reset by itself");
    }
    check(axis.phase == FSN_AXIS_FAULTED, "a fault");
    check(fsn_axis_enable(&axis) == FSN_E_STATE && fsn_axis_reset(&axis) == FSN_OK, "reset first");
    int held = 0;
    do {
        step(motor, 0x0218);
    } while ((o.controlword & 0x80) == 0 && ++held < 50);
    check((o.controlword & 0x80) != 0, "bit 7 has risen");
    step(motor, 0x0250);
    check((o.controlword & 0x80) == 0 && axis.phase == FSN_AXIS_OFF, "it is off");
    std::printf("fault reset, %s\n", fsn_axis_phase_name(axis.phase));
    enable(motor);
    fsn_axis_disable(&axis);
    for (int i = 0; i < 5; i++) {
        step(motor);
    }
    check(axis.phase == FSN_AXIS_OFF, "it is off");
    std::printf("good after %d cycles\n", cycles);
    return 0;
}
