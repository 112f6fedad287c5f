/** A foreign MainDevice: the DS402 class of KickCAT on the first SubDevice of an interface.
 *  ds402_peer INTERFACE COUNTS_PER_REV: brings it to Operation enabled, turns it by two revolutions
 *  and back in CSP, disables it. Prints what it saw as JSON. Built against a KickCAT source tree by
 *  test_ds402.py; nothing of KickCAT is part of this project. */
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "kickcat/Bus.h"
#include "kickcat/CoE/CiA/DS402/Drive.h"
#include "kickcat/Link.h"
#include "kickcat/OS/Timer.h"
#include "kickcat/helpers.h"

using namespace kickcat;

int main(int argc, char *argv[]) {
    if (argc != 3) {
        return 2;
    }
    const double counts = std::atof(argv[2]);
    auto [first, second] = createSockets(argv[1], "");
    auto link = std::make_shared<Link>(first, second, [] {});
    link->setTimeout(50ms);
    Bus bus{link};
    uint8_t image[256] = {};
    bus.init();
    bus.requestState(State::PRE_OP);
    bus.waitForState(State::PRE_OP, 10000ms);
    Slave &device = bus.slaves().at(0);
    CoE::CiA::DS402::Drive drive(bus, device);
    drive.setUnits({counts, 1.0, 1.0});
    drive.configure(CoE::CiA::DS402::control::POSITION_CYCLIC);
    drive.setInterpolationTimePeriod(1, -3);
    drive.setMaxTorqueSDO(2500);
    bus.createMapping(image, sizeof image);
    bus.requestState(State::SAFE_OP);
    bus.waitForState(State::SAFE_OP, 10000ms);
    int lost = 0;
    auto count = [&lost](const DatagramState &) { lost++; };
    bus.processDataRead(count);
    bus.processDataWrite(count);
    drive.attach();
    bus.requestState(State::OPERATIONAL);
    bus.waitForState(State::OPERATIONAL, 10000ms, [&] {
        bus.processDataRead(count);
        bus.processDataWrite(count);
    });
    drive.enable();
    Timer timer{1ms};
    timer.start();
    auto cycle = [&] {
        timer.wait_next_tick();
        try {
            bus.sendLogicalRead(count);
            bus.sendLogicalWrite(count);
            bus.finalizeDatagrams();
            bus.processAwaitingFrames();
        } catch (const std::exception &) {
            lost++; /* a busy machine answers late */
        }
        drive.update();
    };
    int waited = 0;
    while (!drive.isEnabled() && waited < 30000) {
        cycle();
        waited++;
    }
    const int32_t start = drive.actualPositionRaw();
    int32_t furthest = 0;
    int32_t fastest = 0;
    const int cycles = 2000;
    for (int i = 0; i < cycles && drive.isEnabled(); i++) {
        const double turned = 1.0 - std::cos(2.0 * M_PI * i / cycles);
        drive.setTargetPositionRaw(start + static_cast<int32_t>(turned * counts));
        cycle();
        furthest = std::max(furthest, drive.actualPositionRaw() - start);
        fastest = std::max(fastest, drive.actualVelocityRaw());
    }
    const bool stayed = drive.isEnabled() && !drive.isFaulted();
    for (int i = 0; i < 200; i++) {
        cycle();
    }
    const int32_t end = drive.actualPositionRaw() - start;
    drive.disable();
    for (int i = 0; i < 200; i++) {
        cycle();
    }
    std::printf("{\"enabled_after\": %d, \"stayed\": %s, \"furthest\": %d, \"fastest\": %d, "
                "\"end\": %d, \"mode\": %d, \"error\": %u, \"status_at_end\": %u, \"lost\": %d}\n",
                waited, stayed ? "true" : "false", furthest, fastest, end,
                drive.modeOfOperationDisplay(), drive.errorCode(), drive.statusWord(), lost);
    return 0;
}
